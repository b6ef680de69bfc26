//! One HTML file that plays a recording.

use super::record::Recording;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

const STYLE: &str = include_str!("player/style.css");
const SCRIPTS: [&str; 3] =
    [include_str!("player/decode.js"), include_str!("player/draw.js"), include_str!("player/main.js")];

const CONTROLS: &str = "\
<canvas id=\"canvas\" tabindex=\"-1\" aria-label=\"The mesh as the camera of the flight sees it; drag to look from outside\"></canvas>
<div id=\"message\" role=\"status\">Unpacking the flight</div>
<footer>
<div class=\"row\">
<button id=\"play\">Play</button>
<input id=\"scrub\" type=\"range\" min=\"0\" value=\"0\" aria-label=\"Frame\">
<button id=\"speed\" title=\"Speed\">1×</button>
</div>
<div class=\"row\">
<label for=\"tau\" id=\"tau-now\">tau</label>
<input id=\"tau\" type=\"range\" min=\"0\" value=\"0\" aria-label=\"Tolerance\">
<button id=\"outside\" aria-pressed=\"false\">Outside</button>
<button id=\"wire\" aria-pressed=\"false\">Wireframe</button>
<button id=\"theme\">Light / dark</button>
<span id=\"counts\"></span>
</div>
<div class=\"row\" id=\"keys\"><span><kbd>space</kbd> play <kbd>←</kbd> <kbd>→</kbd> frame <kbd>[</kbd> <kbd>]</kbd> tolerance \
<kbd>O</kbd> from outside <kbd>W</kbd> wireframe <kbd>S</kbd> speed <kbd>T</kbd> theme; drag and wheel, or fingers, move the outside view</span></div>
</footer>
";

/// The page: everything is in it, our own script too; nothing is fetched. It needs WebGL 2 and `DecompressionStream` (browsers since 2023).
pub fn player_page(recording: &Recording, title: &str) -> String {
    let data = STANDARD.encode(recording.to_bytes());
    let title = crate::report::escaped(title);
    let script = SCRIPTS.map(|s| s.replacen("\"use strict\";\n", "", 1)).concat();
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n{CONTROLS}\
         <script type=\"text/plain\" id=\"flight\">{data}</script>\n\
         <script>\n\"use strict\";\n{script}</script>\n</body>\n</html>\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_has_all_in_it() {
        let page = player_page(&Recording { blocks: vec![vec![1, 2, 3]] }, "<a> & b");
        assert!(page.contains("<title>&lt;a&gt; &amp; b</title>"));
        for outside in ["http:", "https:", " src=", "<link", "import ", "fetch(", "@import", "url("] {
            assert!(!page.contains(outside), "{outside}");
        }
        // What the script asks for is there.
        let script = SCRIPTS.concat();
        for part in script.split("$(\"").skip(1) {
            let id = part.split('"').next().unwrap();
            assert!(CONTROLS.contains(&format!("id=\"{id}\"")) || id == "flight", "{id}");
        }
        assert_eq!(page.matches("</script>").count(), 2);
        let [open, close] = ['{', '}'].map(|c| script.matches(c).count());
        assert_eq!(open, close);
    }
}
