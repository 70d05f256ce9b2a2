//! Creates buffers, and turns a refusal for lack of memory and the loss of the device into a
//! [`GpuError`] instead of a panic in wgpu's default error handler.
//!
//! On native backends an error scope answers as soon as it is popped. In browsers it answers later,
//! after the call that needs the answer has returned. This file therefore opens no scope there, and
//! a refusal reaches the engine's own error scope or its handler for uncaptured errors.

use super::bindings::label_of;
use super::error::GpuError;
use super::probe;

/// Creates a buffer of `bytes` bytes. `what` names its content, in errors and, with the library's name, in graphics
/// debuggers.
///
/// Fails with [`GpuError::OutOfMemory`] and [`GpuError::DeviceLost`]; never in browsers. A buffer that it returns is
/// valid even if the device is lost later, and wgpu reports no error where commands name it.
pub(super) fn create_buffer(
    device: &wgpu::Device,
    what: &'static str,
    bytes: u64,
    usage: wgpu::BufferUsages,
) -> Result<wgpu::Buffer, GpuError> {
    let label = label_of(what);
    let descriptor = wgpu::BufferDescriptor { label: Some(&label), size: bytes, usage, mapped_at_creation: false };
    let (buffer, is_refused) = scoped(device, wgpu::ErrorFilter::OutOfMemory, || device.create_buffer(&descriptor));
    #[cfg(test)]
    let is_refused = is_refused | refusals::is_due(refusals::Kind::Buffer);
    if is_refused {
        return Err(GpuError::OutOfMemory { what, bytes });
    }
    probe::check(device)?;
    Ok(buffer)
}

/// Runs `work`, and also returns whether the device refused it memory other than for a buffer by
/// [`create_buffer`]. Always `false` in browsers.
pub(super) fn watch<T>(device: &wgpu::Device, work: impl FnOnce() -> T) -> (T, bool) {
    let (result, is_refused) = scoped(device, wgpu::ErrorFilter::OutOfMemory, work);
    #[cfg(test)]
    let is_refused = is_refused | refusals::is_due(refusals::Kind::Other);
    (result, is_refused)
}

/// Runs `work`, and also returns whether an error of this kind occurred that no inner scope caught.
#[cfg(not(target_family = "wasm"))]
fn scoped<T>(device: &wgpu::Device, filter: wgpu::ErrorFilter, work: impl FnOnce() -> T) -> (T, bool) {
    use std::pin::pin;
    use std::task::{Context, Poll, Waker};

    let scope = device.push_error_scope(filter);
    let result = work();
    let error = pin!(scope.pop()).poll(&mut Context::from_waker(Waker::noop()));
    (result, matches!(error, Poll::Ready(Some(_))))
}

/// Runs `work` without a scope: see the module's documentation.
#[cfg(target_family = "wasm")]
fn scoped<T>(_device: &wgpu::Device, _filter: wgpu::ErrorFilter, work: impl FnOnce() -> T) -> (T, bool) {
    (work(), false)
}

/// Refusals on demand, for tests. No device refuses memory reliably: software devices allocate when
/// memory is first written, and cap the size of a buffer below what the host has.
#[cfg(test)]
pub(super) mod refusals {
    use std::cell::Cell;
    use std::marker::PhantomData;

    /// What is refused.
    #[derive(Clone, Copy, PartialEq)]
    pub enum Kind {
        /// A buffer.
        Buffer,
        /// Anything else: the staging memory of a write, or a pipeline.
        Other,
    }

    thread_local! {
        /// What is refused, and how many requests for it still succeed.
        static REFUSED: Cell<Option<(Kind, u32)>> = const { Cell::new(None) };
        /// How many requests were refused.
        static COUNT: Cell<u32> = const { Cell::new(0) };
    }

    /// Refuses memory on this thread until it is dropped.
    pub(in crate::gpu) struct Refusals {
        /// The state belongs to the thread.
        is_not_send: PhantomData<*const ()>,
    }

    impl Refusals {
        /// Refuses all buffers except the first `successes`.
        pub fn of_buffers_after(successes: u32) -> Self {
            Self::new(Kind::Buffer, successes)
        }

        /// Refuses everything except buffers.
        pub fn of_other_memory() -> Self {
            Self::new(Kind::Other, 0)
        }

        fn new(kind: Kind, successes: u32) -> Self {
            REFUSED.set(Some((kind, successes)));
            COUNT.set(0);
            Self { is_not_send: PhantomData }
        }

        /// How many requests were refused so far.
        pub fn count(&self) -> u32 {
            COUNT.get()
        }
    }

    impl Drop for Refusals {
        fn drop(&mut self) {
            REFUSED.set(None);
        }
    }

    pub(super) fn is_due(kind: Kind) -> bool {
        match REFUSED.get() {
            Some((refused, 0)) if refused == kind => {
                COUNT.set(COUNT.get() + 1);
                true
            }
            Some((refused, successes)) if refused == kind => {
                REFUSED.set(Some((refused, successes - 1)));
                false
            }
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::refusals::Refusals;
    use super::*;
    use crate::gpu::testing::noop;

    const USAGE: wgpu::BufferUsages = wgpu::BufferUsages::STORAGE;

    #[test]
    fn a_scope_reports_its_errors_at_once_and_not_those_of_an_inner_scope() {
        let (device, _queue) = noop();
        // A buffer beyond the limit is an error of another kind, which scopes report alike.
        let too_large = wgpu::BufferDescriptor {
            label: None,
            size: device.limits().max_buffer_size + 4,
            usage: USAGE,
            mapped_at_creation: false,
        };
        let filter = wgpu::ErrorFilter::Validation;
        let inner = || scoped(&device, filter, || drop(device.create_buffer(&too_large))).1;
        assert_eq!(scoped(&device, filter, inner), (true, false));
        assert_eq!(scoped(&device, filter, || 7), (7, false));
    }

    #[test]
    fn a_refused_buffer_is_a_typed_error() {
        let (device, _queue) = noop();
        let refusals = Refusals::of_buffers_after(1);
        assert_eq!(create_buffer(&device, "test records", 64, USAGE).map(|buffer| buffer.size()), Ok(64));
        let refused = GpuError::OutOfMemory { what: "test records", bytes: 128 };
        assert_eq!(create_buffer(&device, "test records", 128, USAGE).err(), Some(refused));
        drop(refusals);
        assert!(create_buffer(&device, "test records", 128, USAGE).is_ok());
    }
}
