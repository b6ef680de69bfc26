//! One HTML file with everything in it.

use super::picture::Picture;
use super::table::Table;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

/// A page in the making: a title, then what is added, in order.
///
/// The result refers to nothing outside itself and runs no script; its colours follow the reader's choice of light or dark.
#[derive(Clone, Debug)]
pub struct Page {
    title: String,
    body: String,
}

const STYLE: &str = "\
:root{color-scheme:light dark;--line:#8884;--dim:#767676}\
body{font:15px/1.5 system-ui,sans-serif;max-width:1500px;margin:2em auto;padding:0 1em}\
h1{font-size:1.4em;overflow-wrap:anywhere}h2{font-size:1.1em;margin-top:2em}\
table{border-collapse:collapse;margin:1em 0;font-variant-numeric:tabular-nums}\
th,td{padding:.25em .8em;border-bottom:1px solid var(--line);text-align:right;white-space:nowrap}\
th:first-child,td:first-child{text-align:left;padding-left:0}\
.wide{overflow-x:auto}\
figure{margin:1em 0}figcaption{color:var(--dim)}\
img{max-width:100%;height:auto;background:#fff;border-radius:6px}";

impl Page {
    /// A page of this title and nothing else.
    pub fn new(title: &str) -> Page {
        Page { title: escaped(title), body: format!("<h1>{}</h1>\n", escaped(title)) }
    }

    /// A heading.
    pub fn heading(&mut self, text: &str) {
        self.body += &format!("<h2>{}</h2>\n", escaped(text));
    }

    /// A paragraph.
    pub fn paragraph(&mut self, text: &str) {
        self.body += &format!("<p>{}</p>\n", escaped(text));
    }

    /// A table.
    pub fn table(&mut self, table: &Table) {
        let row = |tag: &str, cells: &[String]| -> String {
            let cells: String = cells.iter().map(|c| format!("<{tag}>{}</{tag}>", escaped(c))).collect();
            format!("<tr>{cells}</tr>")
        };
        self.body += "<div class=\"wide\"><table>\n<thead>";
        self.body += &row("th", &table.head);
        self.body += "</thead>\n<tbody>\n";
        table.rows.iter().for_each(|r| self.body += &(row("td", r) + "\n"));
        self.body += "</tbody></table></div>\n";
    }

    /// A picture with a caption, which also stands for it where it cannot be seen. One without pixels is left out.
    pub fn picture(&mut self, picture: &Picture, caption: &str) {
        let Some(png) = picture.png() else { return };
        let caption = escaped(caption);
        self.body += &format!(
            "<figure><img width=\"{}\" height=\"{}\" alt=\"{caption}\" src=\"data:image/png;base64,{}\">\
             <figcaption>{caption}</figcaption></figure>\n",
            picture.width(),
            picture.height(),
            STANDARD.encode(png)
        );
    }

    /// The file.
    pub fn html(&self) -> String {
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <title>{}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n{}</body>\n</html>\n",
            self.title, self.body
        )
    }
}

/// Text as HTML has it.
pub(crate) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c if c.is_control() && c != '\n' => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_names_hold_is_text() {
        let mut page = Page::new("<b>&\"x\"");
        let mut table = Table::new(&["a", "<i>"]);
        table.row(["</table>", "1"]);
        page.table(&table);
        page.heading("h");
        page.paragraph("p");
        page.picture(&Picture::new(2, 1, [1; 3]), "\"onload=");
        page.picture(&Picture::new(0, 0, [1; 3]), "none");
        let html = page.html();
        assert!(html.contains("<title>&lt;b&gt;&amp;&quot;x&quot;</title>"));
        assert!(html.contains("<td>&lt;/table&gt;</td>") && html.contains("alt=\"&quot;onload=\""));
        assert_eq!(html.matches("<img").count(), 1);
        assert_eq!((html.matches("<tr>").count(), html.matches("</tr>").count()), (2, 2));
    }
}
