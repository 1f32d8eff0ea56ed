//! What can be identified: rank on a structural twin, what the data excite, symmetries in words.

mod anchors;
mod answer;
mod choice;
mod compressed;
mod order;
mod question;
mod robot_question;
mod select;
mod symmetry;
mod twin;

pub use answer::{DataAnswer, Gap, Identification, Identified, Indices, RankOf, Scaling, Step};
pub use choice::{Choice, Status};
pub use order::{default_preference, in_order};
pub use question::Question;
pub use robot_question::{Asked, RobotQuestion};
pub use select::select;
pub use symmetry::{Motion, Symmetry, direction};
pub(crate) use twin::SEED;
