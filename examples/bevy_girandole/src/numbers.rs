//! Numbers for lights, meshes and entities, which are given out again once they are free.

/// Numbers from 0 on.
#[derive(Debug, Default)]
pub struct Numbers {
    free: Vec<u32>,
    count: u32,
}

impl Numbers {
    /// A number that is free.
    pub fn take(&mut self) -> u32 {
        self.free.pop().unwrap_or_else(|| {
            self.count += 1;
            self.count - 1
        })
    }

    /// Takes numbers back.
    pub fn free(&mut self, numbers: impl IntoIterator<Item = u32>) {
        self.free.extend(numbers);
    }
}
