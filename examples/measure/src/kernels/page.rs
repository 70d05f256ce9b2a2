//! A web page that compiles every kernel with the browser's own compiler.

use super::subjects::{self, Subject};
use serde_json::json;

/// The page, with the kernels whose names contain `kernel`. It needs no server. Its element
/// `verdict` ends with a line `N compiled, M refused`.
pub fn html(kernel: &str) -> String {
    // Of shaders that share cuts those for all effects do: the other texts are parts of theirs.
    let is_shown = |subject: &Subject| !subject.kernel.starts_with("shared") || subject.effects == "all";
    let chosen = subjects::all().into_iter().filter(|subject| subject.kernel.contains(kernel)).filter(is_shown);
    let kernels: Vec<_> = chosen
        .map(|subject| {
            let name = [subject.kernel, subject.effects].join(" ");
            json!({ "name": name.trim_end(), "entry": subject.entry, "wgsl": subject.wgsl })
        })
        .collect();
    // The text is inside a script element, which "</" could end.
    let kernels = json!(kernels).to_string().replace("</", "<\\/");
    include_str!("page.html").replace("KERNELS", &kernels)
}
