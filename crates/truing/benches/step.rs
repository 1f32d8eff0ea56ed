//! What a step costs with each linear algebra: the analysis of the structure, new numbers with one
//! damping (a Levenberg–Marquardt step that is accepted), and one more damping (one that was rejected).
//!
//!     cargo bench --bench step [-- --quick]
//!
//! All solvers of a table are measured in turn in the same run; the times are medians. What would
//! take a dense solver minutes is left out.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::hint::black_box;
use std::sync::Arc;
use std::time::{Duration, Instant};
use truing::step::{AnyStep, Cholesky, LinearSolver, Qr, SparseCholesky, SparseQr, StepSolver};
use truing::{Linearization, Structure};

/// Constraints with `rows` rows on some blocks of columns.
struct Panels {
    rows: usize,
    /// First column and width of every block of a constraint.
    constraints: Vec<Vec<(usize, usize)>>,
    cols: usize,
}

impl Panels {
    fn linearization(&self) -> Linearization {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut columns = vec![Vec::new(); self.cols];
        for (i, blocks) in self.constraints.iter().enumerate() {
            for (first, width) in blocks {
                for column in &mut columns[*first..first + width] {
                    column.extend(self.rows * i..self.rows * (i + 1));
                }
            }
        }
        let mut structure = Structure {
            rows: self.rows * self.constraints.len(),
            column_starts: vec![0],
            row_indices: Vec::new(),
        };
        for column in columns {
            structure.row_indices.extend(column);
            structure.column_starts.push(structure.row_indices.len());
        }
        let mut lin = Linearization::new(Arc::new(structure));
        let mut number = || random.random_range(-1.0..1.0);
        lin.values.fill_with(&mut number);
        lin.residual.fill_with(&mut number);
        lin
    }
}

fn dense(rows: usize, cols: usize) -> Panels {
    Panels {
        rows: 1,
        constraints: vec![vec![(0, cols)]; rows],
        cols,
    }
}

/// Poses of six columns along a path that folds back beside itself, with a loop for every second.
fn pose_graph(poses: usize) -> Panels {
    let width = 20.min(poses / 2);
    let steps = (1..poses).map(|i| (i - 1, i));
    let loops = (width..poses).step_by(2).map(|i| {
        // The neighbour on the row before, walked the other way.
        let back = 2 * (i % width) + 1;
        (i - back.min(i), i)
    });
    Panels {
        rows: 6,
        constraints: (steps.chain(loops))
            .map(|(a, b)| vec![(6 * a, 6), (6 * b, 6)])
            .collect(),
        cols: 6 * poses,
    }
}

/// Cameras of six columns that see points of three, each from some neighbouring cameras.
fn bundle(cameras: usize, points: usize) -> Panels {
    let mut constraints = Vec::new();
    for point in 0..points {
        let first = point * cameras / points;
        for view in 0..5 {
            let camera = (first + view) % cameras;
            constraints.push(vec![(6 * camera, 6), (6 * cameras + 3 * point, 3)]);
        }
    }
    Panels {
        rows: 2,
        constraints,
        cols: 6 * cameras + 3 * points,
    }
}

fn named(asked: LinearSolver) -> Box<dyn StepSolver> {
    match asked {
        LinearSolver::DenseQr => Box::new(Qr::default()),
        LinearSolver::DenseCholesky => Box::new(Cholesky::default()),
        LinearSolver::SparseCholesky => Box::new(SparseCholesky::default()),
        LinearSolver::SparseQr => Box::new(SparseQr::default()),
        LinearSolver::Auto => Box::new(AnyStep::default()),
    }
}

fn table(title: &str, panels: &Panels, budget: Duration, dense_too: bool) {
    use LinearSolver::{DenseCholesky, DenseQr, SparseCholesky, SparseQr};
    let lin = panels.linearization();
    let free: Vec<usize> = (0..panels.cols).collect();
    let scale: Vec<f64> = free.iter().map(|k| lin.column_norm(*k)).collect();
    let mut auto = AnyStep::default();
    auto.factor(&lin, &free, &scale);
    println!(
        "{title}: {} rows; by default {}, {}",
        lin.structure.rows,
        auto.name(),
        auto.reason().unwrap_or_default()
    );
    println!(
        "  {:<16} {:>12} {:>12} {:>12} {:>8}",
        "", "first [ms]", "step [ms]", "again [ms]", "ratio"
    );
    let all = [DenseQr, DenseCholesky, SparseCholesky, SparseQr];
    let asked = all
        .into_iter()
        .filter(|asked| dense_too || matches!(asked, SparseCholesky | SparseQr));
    let mut runs: Vec<_> = asked
        .map(|asked| (named(asked), [const { Vec::new() }; 3]))
        .collect();
    let start = Instant::now();
    let ms = |start: Instant| start.elapsed().as_secs_f64() * 1e3;
    for round in 0..200 {
        for (solver, times) in &mut runs {
            let start = Instant::now();
            solver.factor(black_box(&lin), &free, &scale);
            let y = solver.solve(1e-4, None).unwrap_or_default();
            black_box(solver.predicted(&y));
            times[usize::from(round > 0)].push(ms(start));
            let start = Instant::now();
            let y = solver.solve(2e-4, None).unwrap_or_default();
            black_box(solver.predicted(&y));
            times[2].push(ms(start));
        }
        if round > 0 && start.elapsed() > budget {
            break;
        }
    }
    let median = |times: &Vec<f64>| {
        let mut times = times.clone();
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    };
    let medians: Vec<[f64; 3]> = (runs.iter())
        .map(|(_, times)| [0, 1, 2].map(|i| median(&times[i])))
        .collect();
    let fastest = medians
        .iter()
        .fold(f64::INFINITY, |least, times| least.min(times[1]));
    for ((solver, _), [first, step, again]) in runs.iter().zip(medians) {
        let (name, ratio) = (solver.name(), step / fastest);
        println!("  {name:<16} {first:>12.3} {step:>12.3} {again:>12.3} {ratio:>8.1}");
    }
}

fn main() {
    let quick = std::env::args().any(|argument| argument == "--quick");
    let budget = Duration::from_millis(if quick { 300 } else { 5000 });
    table("tall, 30 columns", &dense(100_000, 30), budget, true);
    table("dense, 200 columns", &dense(500, 200), budget, true);
    for poses in [5, 10, 20, 50, 500, 5000] {
        let title = format!("pose graph, {} columns", 6 * poses);
        table(&title, &pose_graph(poses), budget, poses < 500);
    }
    for (cameras, points) in [(5, 30), (10, 80), (100, 800), (1000, 8000)] {
        let title = format!("bundle, {} columns", 6 * cameras + 3 * points);
        table(&title, &bundle(cameras, points), budget, points < 800);
    }
    if !quick {
        let title = "pose graph, 1200 columns, dense too";
        table(title, &pose_graph(200), budget, true);
    }
}
