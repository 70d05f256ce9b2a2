//! What plays plans: an object of JavaScript with a method for each kind of command.

use girandole::plan::{BufferId, BufferKind, Command, Commands, NewBuffer};
use wasm_bindgen::JsValue;
use wasm_bindgen::prelude::wasm_bindgen;

use crate::failure::Failure;

#[wasm_bindgen(typescript_custom_section)]
const TYPES: &str = r#"
/**
 * Plays plans on a device. Each command sees what the commands before it have done. Buffers are named by numbers.
 */
export interface PlanPlayer {
    /** Makes a buffer. Its content is undefined at first. */
    create(buffer: number, label: string, bytes: number, kind: "uniform" | "storage" | "indirect"): void;
    /** Overwrites bytes of a buffer. They are readable only until the next call of the package. */
    write(buffer: number, offset: number, bytes: Uint8Array): void;
    /** Copies the first bytes of a buffer to the start of another. */
    copy(from: number, to: number, offset: number, bytes: number): void;
    /** Sets bytes of a buffer to zero. */
    clear(buffer: number, offset: number, bytes: number): void;
    /** Runs a kernel with the buffers of its bindings. */
    dispatch(kernel: string, buffers: Uint32Array, uniformOffset: number, x: number, y: number, z: number): void;
    /** Runs a kernel with as many workgroups as an indirect buffer says. */
    dispatchIndirect(kernel: string, buffers: Uint32Array, uniformOffset: number, workgroups: number): void;
    /** Frees a buffer once the commands before have run. */
    free(buffer: number): void;
}
"#;

#[wasm_bindgen]
extern "C" {
    #[wasm_bindgen(typescript_type = "PlanPlayer")]
    pub type PlanPlayer;

    #[wasm_bindgen(method, catch)]
    fn create(this: &PlanPlayer, buffer: u32, label: &str, bytes: f64, kind: &str) -> Result<(), JsValue>;
    #[wasm_bindgen(method, catch)]
    fn write(this: &PlanPlayer, buffer: u32, offset: f64, bytes: &[u8]) -> Result<(), JsValue>;
    #[wasm_bindgen(method, catch)]
    fn copy(this: &PlanPlayer, from: u32, to: u32, offset: f64, bytes: f64) -> Result<(), JsValue>;
    #[wasm_bindgen(method, catch)]
    fn clear(this: &PlanPlayer, buffer: u32, offset: f64, bytes: f64) -> Result<(), JsValue>;
    #[wasm_bindgen(method, catch)]
    fn dispatch(
        this: &PlanPlayer,
        kernel: &str,
        buffers: Vec<u32>,
        offset: u32,
        x: u32,
        y: u32,
        z: u32,
    ) -> Result<(), JsValue>;
    #[wasm_bindgen(method, catch, js_name = dispatchIndirect)]
    fn dispatch_indirect(
        this: &PlanPlayer,
        kernel: &str,
        buffers: Vec<u32>,
        offset: u32,
        workgroups: u32,
    ) -> Result<(), JsValue>;
    #[wasm_bindgen(method, catch)]
    fn free(this: &PlanPlayer, buffer: u32) -> Result<(), JsValue>;
}

/// Sizes and offsets are below 2^53, which the numbers of JavaScript count exactly.
fn number(bytes: u64) -> f64 {
    bytes as f64
}

fn numbers(buffers: &[BufferId]) -> Vec<u32> {
    buffers.iter().map(|id| id.get()).collect()
}

impl PlanPlayer {
    pub fn make(&self, buffer: &NewBuffer) -> Result<(), Failure> {
        let kind = match buffer.kind {
            BufferKind::Uniform => "uniform",
            BufferKind::Indirect => "indirect",
            _ => "storage",
        };
        self.create(buffer.id.get(), buffer.what, number(buffer.bytes), kind).map_err(Failure::Thrown)
    }

    pub fn play(&self, commands: &Commands) -> Result<(), Failure> {
        commands.iter().try_for_each(|command| self.play_one(command))
    }

    fn play_one(&self, command: Command<'_>) -> Result<(), Failure> {
        let played = match command {
            Command::Write { buffer, offset, bytes } => self.write(buffer.get(), number(offset), bytes),
            Command::Copy { from, to, offset, bytes } => self.copy(from.get(), to.get(), number(offset), number(bytes)),
            Command::Clear { buffer, offset, bytes } => self.clear(buffer.get(), number(offset), number(bytes)),
            Command::Dispatch { kernel, buffers, uniform_offset, workgroups: [x, y, z] } => {
                self.dispatch(kernel.entry(), numbers(buffers), uniform_offset, x, y, z)
            }
            Command::DispatchIndirect { kernel, buffers, uniform_offset, workgroups } => {
                self.dispatch_indirect(kernel.entry(), numbers(buffers), uniform_offset, workgroups.get())
            }
            _ => return Err(Failure::Plain(format!("a player has no command like {command:?}"))),
        };
        played.map_err(Failure::Thrown)
    }

    pub fn let_go(&self, freed: &[BufferId]) -> Result<(), Failure> {
        freed.iter().try_for_each(|id| self.free(id.get()).map_err(Failure::Thrown))
    }
}
