//! What a firmware image holds.

use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::fs;
use std::path::Path;

use object::read::elf::ElfFile32;
use object::{Object, ObjectSection, ObjectSymbol, RelocationTarget, SectionKind, SymbolKind};

/// Parts of symbols that mean panics, their messages, or an allocator.
const UNWANTED_SYMBOLS: [&str; 5] = ["panic", "unwind", "_failed", "3fmt", "alloc"];

/// Parts of texts that mean the same. A panic says in which source file it is.
const UNWANTED_TEXTS: [&str; 6] = [".rs", "panic", "unwrap", "attempt to", "out of", "alloc"];

/// The shortest run of letters that is taken for a text.
const SHORTEST_TEXT: usize = 6;

/// A firmware image.
pub(crate) struct Image {
    /// The bytes of code and data.
    pub(crate) size: u64,
    symbols: Vec<String>,
    texts: Vec<String>,
    /// The size of each function, by its address.
    functions: BTreeMap<u64, u64>,
    /// From where in the code to which function, if it was linked with its relocations.
    references: Vec<(u64, u64)>,
}

impl Image {
    pub(crate) fn read(path: &Path) -> Result<Self, Box<dyn Error>> {
        let data = fs::read(path).map_err(|error| format!("{}: {error}", path.display()))?;
        let file: ElfFile32<'_> = ElfFile32::parse(&*data)?;
        let mut image = Image {
            size: 0,
            symbols: Vec::new(),
            texts: Vec::new(),
            functions: BTreeMap::new(),
            references: Vec::new(),
        };
        for symbol in file.symbols() {
            image.symbols.push(symbol.name()?.to_owned());
            if symbol.kind() == SymbolKind::Text && symbol.size() > 0 {
                image.functions.insert(even(symbol.address()), symbol.size());
            }
        }
        let loaded =
            [SectionKind::Text, SectionKind::ReadOnlyData, SectionKind::Data, SectionKind::UninitializedData];
        for section in file.sections().filter(|section| loaded.contains(&section.kind())) {
            image.size += section.size();
        }
        let code = file.section_by_name(".text").ok_or("no .text")?;
        let texts = code.data()?.split(|byte| !(b' '..=b'~').contains(byte));
        let texts = texts.filter(|text| text.len() >= SHORTEST_TEXT);
        image.texts.extend(texts.map(|text| String::from_utf8_lossy(text).into_owned()));
        for (from, relocation) in code.relocations() {
            if let RelocationTarget::Symbol(index) = relocation.target() {
                image.references.push((from, even(file.symbol_by_index(index)?.address())));
            }
        }
        Ok(image)
    }

    /// The bytes of the function at `address` and of every function it refers to, at any remove. `None` if
    /// there is no function.
    pub(crate) fn reach(&self, address: u64) -> Option<u64> {
        self.functions.get(&address)?;
        let (mut reached, mut next) = (BTreeSet::new(), vec![address]);
        let mut sum = 0;
        while let Some(address) = next.pop() {
            let Some(&size) = self.functions.get(&address) else { continue };
            if reached.insert(address) {
                sum += size;
                let inside = |from: &u64| (address..address + size).contains(from);
                next.extend(self.references.iter().filter(|(from, _)| inside(from)).map(|&(_, to)| to));
            }
        }
        Some(sum)
    }

    /// The symbols and texts that mean panics or an allocator.
    pub(crate) fn unwanted(&self) -> Vec<&str> {
        let symbols =
            self.symbols.iter().filter(|name| UNWANTED_SYMBOLS.iter().any(|part| name.contains(part)));
        let texts = self.texts.iter().filter(|text| UNWANTED_TEXTS.iter().any(|part| text.contains(part)));
        symbols.chain(texts).map(String::as_str).collect()
    }

    /// The number of functions with this last name.
    pub(crate) fn functions_named(&self, name: &str) -> usize {
        // What follows the last name is a hash of 17 characters.
        let mangled = format!("{}{name}17h", name.len());
        self.symbols.iter().filter(|symbol| symbol.contains(&mangled)).count()
    }
}

/// The lowest bit of a function's address says Thumb.
fn even(address: u64) -> u64 {
    address & !1
}
