//! A page as a document: sections of sentences, tables and charts.

use std::fmt::{self, Display, Formatter, Write};

use super::figure::{Chart, Drawn};
use super::text;
use crate::text::is_invisible;

/// The charting library, plotly.js by its name: the bundle of lines, bars and their axes. See plotly/README.md.
const LIBRARY: &str = include_str!("plotly/plotly-basic.min.js");
const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("page.js");
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

/// A page before it is written. All of its text is escaped when it is.
pub(super) struct Page<'a> {
    pub(super) title: String,
    /// Below the title: sentences, the first as the headline.
    pub(super) lead: Vec<String>,
    pub(super) warnings: &'a [String],
    pub(super) sections: Vec<Section>,
    /// The command that made the page.
    pub(super) command: &'a str,
    /// The program and version that made it.
    pub(super) generator: &'a str,
}

/// A part of a page with a heading.
#[derive(Default)]
pub(super) struct Section {
    pub(super) title: String,
    pub(super) blocks: Vec<Block>,
}

/// What sections are made of.
pub(super) enum Block {
    /// A sentence or more.
    Text(String),
    /// What can be typed.
    Command(String),
    Table(Table),
    Chart(Chart),
}

/// A table with a heading for each column. The first cell of a row names it.
pub(super) struct Table {
    pub(super) caption: String,
    pub(super) head: Vec<String>,
    pub(super) rows: Vec<Vec<String>>,
    /// The columns that hold figures: they end at one line.
    figures: Vec<bool>,
}

impl Table {
    pub(super) fn new(caption: impl Into<String>, head: &[&str]) -> Self {
        Self {
            caption: caption.into(),
            head: head.iter().map(|name| (*name).to_owned()).collect(),
            rows: Vec::new(),
            figures: Vec::new(),
        }
    }

    fn is_figures(&self, column: usize) -> bool {
        self.figures.get(column).is_some_and(|figures| *figures)
    }

    /// The same with rows for columns.
    pub(super) fn turned(self) -> Self {
        let lines: Vec<&Vec<String>> = std::iter::once(&self.head).chain(&self.rows).collect();
        let column = |k: usize| lines.iter().filter_map(|line| line.get(k)).cloned().collect();
        let rows = (1..self.head.len()).map(column).collect();
        Self { head: column(0), rows, caption: self.caption, figures: Vec::new() }
    }

    pub(super) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }
}

impl Section {
    pub(super) fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), blocks: Vec::new() }
    }

    pub(super) fn text(&mut self, text: impl Into<String>) {
        self.blocks.push(Block::Text(text.into()));
    }

    /// Adds a table, if it has rows.
    pub(super) fn table(&mut self, mut table: Table) {
        let figure = |text: &String| {
            let is_word = |c: char| c.is_alphabetic() && !matches!(c, 'e' | 'i');
            text.is_empty()
                || (text.starts_with(|first: char| "–±<-0123456789".contains(first))
                    && !text.contains(is_word))
        };
        let column = |k: usize| k > 0 && table.rows.iter().filter_map(|row| row.get(k)).all(figure);
        table.figures = (0..table.head.len()).map(column).collect();
        if table.rows.iter().flatten().any(|cell| cell == text::NONE) {
            table.caption = format!("{} ({}: not known)", table.caption, text::NONE);
        }
        if !table.rows.is_empty() {
            self.blocks.push(Block::Table(table));
        }
    }

    /// Adds a chart, or why there is none.
    pub(super) fn chart(&mut self, drawn: Drawn) {
        self.blocks.push(match drawn {
            Ok(chart) => Block::Chart(chart),
            Err(reason) => Block::Text(reason),
        });
    }
}

impl<'a> Page<'a> {
    pub(super) fn new(title: String, command: &'a str, generator: &'a str) -> Self {
        Self { title, lead: Vec::new(), warnings: &[], sections: Vec::new(), command, generator }
    }

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
        self.lead.iter().try_for_each(|sentence| writeln!(f, "<p>{}</p>", Text(sentence)))?;
        writeln!(f, "{NO_SCRIPT}\n</header>\n<nav aria-label=\"Sections\">\n<ul>")?;
        for (number, section) in (1..).zip(&self.sections) {
            writeln!(f, r##"<li><a href="#section-{number}">{}</a></li>"##, Text(&section.title))?;
        }
        writeln!(f, "<li><a href=\"#command\">Command</a></li>\n</ul>\n</nav>\n<main>")?;
        if !self.warnings.is_empty() {
            writeln!(f, r#"<section aria-labelledby="warnings" class="note">"#)?;
            writeln!(f, "<h2 id=\"warnings\">Warnings</h2>\n<ul>")?;
            self.warnings.iter().try_for_each(|warning| writeln!(f, "<li>{}</li>", Text(warning)))?;
            writeln!(f, "</ul>\n</section>")?;
        }
        for (number, section) in (1..).zip(&self.sections) {
            writeln!(f, r#"<section aria-labelledby="section-{number}">"#)?;
            writeln!(f, r#"<h2 id="section-{number}">{}</h2>"#, Text(&section.title))?;
            section.blocks.iter().try_for_each(|block| block.fmt(f))?;
            writeln!(f, "</section>")?;
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

impl Display for Block {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Text(text) => writeln!(f, "<p>{}</p>", Text(text)),
            Self::Command(text) => writeln!(f, "<pre><code>{}</code></pre>", Text(text)),
            Self::Table(table) => table.fmt(f),
            Self::Chart(Chart { title, words, height, json }) => {
                let (title, words) = (Text(title), Text(words));
                writeln!(f, "<figure>\n<h3>{title}</h3>")?;
                write!(f, r#"<div class="chart" role="img" aria-label="{title}. {words}" "#)?;
                writeln!(f, r#"style="height:{height}px"></div>"#)?;
                writeln!(f, r#"<script type="application/json">{json}</script>"#)?;
                writeln!(f, "<figcaption>{words}</figcaption>\n</figure>")
            }
        }
    }
}

impl Display for Table {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let caption = Text(&self.caption);
        let class = |column: usize| if self.is_figures(column) { r#" class="figure""# } else { "" };
        writeln!(f, r#"<div class="table" role="region" aria-label="{caption}" tabindex="0">"#)?;
        write!(f, "<table>\n<caption>{caption}</caption>\n<thead><tr>")?;
        for (column, name) in self.head.iter().enumerate() {
            write!(f, r#"<th scope="col"{}>{}</th>"#, class(column), Text(name))?;
        }
        writeln!(f, "</tr></thead>\n<tbody>")?;
        for row in &self.rows {
            f.write_str("<tr>")?;
            for (column, cell) in row.iter().map(|cell| Text(cell)).enumerate() {
                match column {
                    0 => write!(f, r#"<th scope="row">{cell}</th>"#)?,
                    _ => write!(f, "<td{}>{cell}</td>", class(column))?,
                }
            }
            writeln!(f, "</tr>")?;
        }
        writeln!(f, "</tbody>\n</table>\n</div>")
    }
}

#[cfg(test)]
mod tests {
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
        let page = Page::new(String::new(), "", "").write();
        assert_eq!(page.matches("<script>").count(), 2);
        assert!(!page.contains("nonce="));
    }

    #[test]
    fn text_is_no_markup() {
        assert_eq!(Text("<a href=\"'\">&").to_string(), "&lt;a href=&quot;&#39;&quot;&gt;&amp;");
        assert_eq!(Text("a\u{202e}b\x1b[31m\nc").to_string(), "a\\u{202e}b\\u{1b}[31m\nc");
    }
}
