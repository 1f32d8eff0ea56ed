//! What judging a calibration costs beside estimating it: positions of a PUMA-like robot, 982 as irb120_faro has and more.
//!
//!     cargo bench --bench judge
//!
//! Both are stages of the same run; the times are medians of five.

#[path = "../tests/support/flaws.rs"]
#[allow(dead_code, reason = "the simulator has more than a bench uses")]
mod flaws;
#[path = "../tests/support/forward.rs"]
#[allow(dead_code, reason = "the simulator has more than a bench uses")]
mod forward;

use flaws::{Data, Flaw, case, robots};
use std::cell::RefCell;
use std::time::Instant;
use truing_robot::estimate::Stage;

fn main() {
    println!("positions  registering, identifying, estimating [ms]  judging [ms]  ratio");
    for count in [100, 982, 10_000] {
        let case = case(&robots()[0], &Flaw::plain(Data::Tracker, count), 1)
            .expect("positions are drawn anywhere");
        let mut times: Vec<(f64, f64)> = (0..5)
            .map(|_| {
                let began = Instant::now();
                let judging = RefCell::new(began);
                let watch = |stage| {
                    if stage == Stage::Validating {
                        *judging.borrow_mut() = Instant::now();
                    }
                };
                case.calibration.run(&watch).expect("it has a solution");
                let judging = judging.into_inner();
                let ms = |from: Instant, to: Instant| (to - from).as_secs_f64() * 1e3;
                (ms(began, judging), ms(judging, Instant::now()))
            })
            .collect();
        times.sort_by(|a, b| (a.1 / a.0).total_cmp(&(b.1 / b.0)));
        let (estimating, judging) = times[2];
        println!(
            "{count:9}  {estimating:46.1}  {judging:12.1}  {:5.2}",
            judging / estimating
        );
    }
}
