//! Tests of the plugin, without a window. They need a Vulkan driver, of which Mesa's lavapipe is
//! enough.

mod agrees_with_bevy;
mod changes;
mod dump;
mod harness;
mod heat_map;
mod lifecycle;
mod names;
mod refusals;
mod shadow_rays;
mod shadows;
mod sky;
mod textures;
mod unbiased;
mod written;
