//! Documents as pages: one file of HTML that loads nothing, with charts that can be zoomed.
//!
//! Names of channels and files are shown as they are, whatever is in them: text is escaped where it is written, and the
//! charts have escaped their own. A content security policy forbids every request and every script but the page's own.

use std::fmt::{self, Display, Formatter, Write};

use super::charts::Chart;
use super::tree::{Cell, Item, Section, Sections, Table};
use crate::text::is_invisible;

/// The charting library, plotly.js by its name: the bundle of lines, bars and their axes. See plotly/README.md.
const LIBRARY: &str = include_str!("html/plotly/plotly-basic.min.js");
const STYLE: &str = include_str!("html/style.css");
const SCRIPT: &str = include_str!("html/page.js");
/// What stands where there is no figure.
const NONE: &str = "–";
/// Up to the title. The policy forbids every request, and every script but these two, which it knows by the SHA-256 of
/// what stands between their tags.
const HEAD: &str = r#"<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; script-src 'sha256-Tnz+THrvTSUe6ccKtAMKOzlYnfRQTGOMtDKfOdaJ/3Y=' 'sha256-dc7HTwGujPH4yt2h0B2wrBn11n8tjLg6dJeRAojNJyQ='; style-src 'unsafe-inline'; img-src data: blob:">
<link rel="icon" href="data:,">
"#;
const NO_SCRIPT: &str =
    r#"<noscript><p class="note">The charts need JavaScript. The tables do not.</p></noscript>"#;
const HOW_TO: &str = "It loads nothing from elsewhere. Charts: drag to zoom, double-click to zoom out, hover or tap to read \
                      values, click a name to hide a curve.";

/// A document with what a page has around it. All of its text is escaped when it is written.
pub(super) struct Page<'a> {
    pub(super) title: String,
    pub(super) warnings: &'a [String],
    pub(super) document: Sections,
    /// The command that made the page.
    pub(super) command: &'a str,
    /// The program and version that made it.
    pub(super) generator: &'a str,
}

impl Page<'_> {
    /// The page as HTML.
    pub(super) fn write(&self) -> String {
        self.to_string()
    }
}

/// Text as HTML shows it, in elements and in quoted attributes.
struct Text<'a>(&'a str);

impl Display for Text<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.0.chars().try_for_each(|character| match character {
            '&' => f.write_str("&amp;"),
            '<' => f.write_str("&lt;"),
            '>' => f.write_str("&gt;"),
            '"' => f.write_str("&quot;"),
            '\'' => f.write_str("&#39;"),
            '\n' => f.write_char('\n'),
            // What sets the direction of writing could make a name look like another.
            other if is_invisible(other) => write!(f, "{}", other.escape_default()),
            other => f.write_char(other),
        })
    }
}

impl Display for Page<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let (title, generator) = (Text(&self.title), Text(self.generator));
        f.write_str(HEAD)?;
        writeln!(f, r#"<meta name="generator" content="{generator}">"#)?;
        writeln!(f, "<title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>")?;
        writeln!(f, "<header>\n<h1>{title}</h1>")?;
        let (lead, sections): (Vec<&Section>, Vec<&Section>) =
            self.document.sections.iter().partition(|section| section.title.is_empty());
        // The first of its sentences is a headline.
        lead.iter().flat_map(|section| &section.items).try_for_each(|item| write_item(f, item))?;
        let sections = || (1..).zip(sections.iter().filter(|section| !section.items.is_empty()));
        writeln!(f, "{NO_SCRIPT}\n</header>\n<nav aria-label=\"Sections\">\n<ul>")?;
        for (number, section) in sections() {
            writeln!(f, r##"<li><a href="#section-{number}">{}</a></li>"##, Text(&section.title))?;
        }
        writeln!(f, "<li><a href=\"#command\">Command</a></li>\n</ul>\n</nav>\n<main>")?;
        if !self.warnings.is_empty() {
            writeln!(f, r#"<section aria-labelledby="warnings" class="note">"#)?;
            writeln!(f, "<h2 id=\"warnings\">Warnings</h2>\n<ul>")?;
            self.warnings.iter().try_for_each(|warning| writeln!(f, "<li>{}</li>", Text(warning)))?;
            writeln!(f, "</ul>\n</section>")?;
        }
        for (number, section) in sections() {
            write_section(f, number, section)?;
        }
        writeln!(f, "</main>\n<footer>\n<h2 id=\"command\">Command</h2>\n<p>This page was made by</p>")?;
        writeln!(f, "<pre><code>{}</code></pre>", Text(self.command))?;
        writeln!(f, "<p>with {generator}. {HOW_TO}</p>\n</footer>")?;
        for script in [LIBRARY, SCRIPT] {
            writeln!(f, "<script>\n{script}</script>")?;
        }
        f.write_str("</body>\n</html>\n")
    }
}

fn write_section(f: &mut Formatter<'_>, number: usize, section: &Section) -> fmt::Result {
    writeln!(f, r#"<section aria-labelledby="section-{number}">"#)?;
    writeln!(f, r#"<h2 id="section-{number}">{}</h2>"#, Text(&section.title))?;
    section.items.iter().try_for_each(|item| write_item(f, item))?;
    writeln!(f, "</section>")
}

fn write_item(f: &mut Formatter<'_>, item: &Item) -> fmt::Result {
    match item {
        Item::Line(line) if line.is_empty() => Ok(()),
        Item::Line(line) => writeln!(f, "<p>{}</p>", Text(line)),
        Item::Command(command) => writeln!(f, "<pre><code>{}</code></pre>", Text(command)),
        Item::Table(table) => write_table(f, table),
        Item::Chart(Chart { title, words, height, json }) => {
            let (title, words) = (Text(title), Text(words));
            writeln!(f, "<figure>\n<h3>{title}</h3>")?;
            write!(f, r#"<div class="chart" role="img" aria-label="{title}. {words}" "#)?;
            writeln!(f, r#"style="height:{height}px"></div>"#)?;
            writeln!(f, r#"<script type="application/json">{json}</script>"#)?;
            writeln!(f, "<figcaption>{words}</figcaption>\n</figure>")
        }
    }
}

fn write_table(f: &mut Formatter<'_>, table: &Table) -> fmt::Result {
    if table.rows.is_empty() {
        return Ok(());
    }
    let none = if table.has_unknown() { format!(" ({NONE}: {})", table.none) } else { String::new() };
    let caption = format!("{}{none}", table.caption);
    let caption = Text(&caption);
    let class = |column: usize| if table.words.contains(&column) { "" } else { r#" class="figure""# };
    writeln!(f, r#"<div class="table" role="region" aria-label="{caption}" tabindex="0">"#)?;
    write!(f, "<table>\n<caption>{caption}</caption>\n<thead><tr>")?;
    for (column, name) in table.head.iter().enumerate() {
        write!(f, r#"<th scope="col"{}>{}</th>"#, class(column), Text(name))?;
    }
    writeln!(f, "</tr></thead>\n<tbody>")?;
    for row in &table.rows {
        f.write_str("<tr>")?;
        for (column, cell) in row.iter().enumerate() {
            let cell = match cell {
                Cell::Unknown => NONE.to_owned(),
                Cell::Words(words) => words.clone(),
                Cell::Figure(value, [_, written]) => written(*value),
            };
            match column {
                0 => write!(f, r#"<th scope="row">{}</th>"#, Text(&cell))?,
                _ => write!(f, "<td{}>{}</td>", class(column), Text(&cell))?,
            }
        }
        writeln!(f, "</tr>")?;
    }
    writeln!(f, "</tbody>\n</table>\n</div>")?;
    table.legend.iter().try_for_each(|line| writeln!(f, "<p>{}</p>", Text(line)))
}

#[cfg(test)]
mod tests {
    use super::super::tree::Medium;
    use super::*;

    #[test]
    fn the_library_stands_in_a_script_element() {
        assert!(LIBRARY.starts_with("/**\n* plotly.js (basic - minified) v"));
        assert!(!LIBRARY.contains("</script") && !LIBRARY.contains("<!--"));
    }

    #[test]
    fn the_policy_knows_the_scripts() {
        use base64::Engine;
        use base64::engine::general_purpose::STANDARD;
        use hmac_sha256::Hash;

        let hash =
            |script| format!("'sha256-{}'", STANDARD.encode(Hash::hash(format!("\n{script}").as_bytes())));
        let policy = format!("script-src {} {};", hash(LIBRARY), hash(SCRIPT));
        assert!(HEAD.contains(&policy), "{policy}");
        let document = Sections::new(Medium::Page);
        let page = Page { title: String::new(), warnings: &[], document, command: "", generator: "" };
        let page = page.to_string();
        assert_eq!(page.matches("<script>").count(), 2);
        assert!(!page.contains("nonce="));
    }

    #[test]
    fn text_is_no_markup() {
        assert_eq!(Text("<a href=\"'\">&").to_string(), "&lt;a href=&quot;&#39;&quot;&gt;&amp;");
        assert_eq!(Text("a\u{202e}b\x1b[31m\nc").to_string(), "a\\u{202e}b\\u{1b}[31m\nc");
    }
}
