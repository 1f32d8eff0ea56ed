//! Scratch memory for faer.

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};

/// Scratch memory that is kept, and grows where more is asked for. A copy has its own.
#[derive(Default)]
pub(super) struct Work(Option<(StackReq, MemBuffer)>);

impl Work {
    /// Memory of at least this size.
    pub fn stack(&mut self, req: StackReq) -> &mut MemStack {
        let kept = self.0.take().filter(|(had, _)| {
            had.size_bytes() >= req.size_bytes() && had.align_bytes() >= req.align_bytes()
        });
        let (_, buffer) = self
            .0
            .insert(kept.unwrap_or_else(|| (req, MemBuffer::new(req))));
        MemStack::new(buffer)
    }
}

impl Clone for Work {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl std::fmt::Debug for Work {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Work")
    }
}
