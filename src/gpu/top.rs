//! stub
use super::{error::GpuError, layout::*, pool::Pool};
use crate::tree::Node;
pub(super) struct TopBuild(Pool<Node>);
impl TopBuild {
    pub fn new(d: &wgpu::Device, q: &wgpu::Queue) -> Result<Self, GpuError> {
        Ok(Self(Pool::new(d, q, "top", 1)?))
    }
    pub fn reserve(&mut self, _s: u32) -> Result<(), GpuError> {
        Ok(())
    }
    pub fn nodes(&self) -> &wgpu::Buffer {
        self.0.buffer()
    }
    pub fn generation(&self) -> u64 {
        self.0.generation()
    }
    pub fn bind(&mut self, _i: &Pool<InstanceRecord>, _t: &Pool<TreeRecord>) {}
    pub fn record(&mut self, _e: &mut wgpu::CommandEncoder, _s: u32) {}
}
