pub use glam;
