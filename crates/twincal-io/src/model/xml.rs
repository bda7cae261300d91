//! XML into a small tree that remembers where everything stood, with limits against hostile files.

use crate::error::{Error, Place, Result};
use quick_xml::events::attributes::AttrError;
use quick_xml::events::{BytesStart, Event};
use quick_xml::name::QName;
use quick_xml::{Reader, XmlVersion};
use std::ops::Range;

/// Largest model file, bytes.
pub(crate) const MAX_BYTES: usize = 32 << 20;
/// Deepest nesting of elements.
pub(crate) const MAX_DEPTH: usize = 256;
/// Most elements and attributes of a model, all files together: a robot of 10 000 links has half as many.
const MAX_ITEMS: usize = 1_000_000;
/// Most attributes of one element.
pub(crate) const MAX_ATTRIBUTES: usize = 64;

/// One attribute: value with entities resolved, and where its raw text stands in the file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Attribute {
    pub(crate) name: String,
    pub(crate) value: String,
    /// Bytes of the raw value between the quotes.
    pub(crate) span: Range<usize>,
}

/// One element; children are indices into [`Document::elements`].
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Element {
    pub(crate) name: String,
    pub(crate) attributes: Vec<Attribute>,
    pub(crate) children: Vec<usize>,
    /// Index into [`Document::files`].
    pub(crate) file: usize,
    /// Byte offset of its `<`.
    pub(crate) offset: usize,
    /// First byte behind the `>` of its start tag.
    pub(crate) inside: usize,
    /// Byte offset of its end tag; `inside` where the start tag is all there is (`<x/>`).
    pub(crate) close: usize,
    /// First byte behind the element.
    pub(crate) end: usize,
}

/// A file's name as shown to people, and its text.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Source {
    pub(crate) name: String,
    pub(crate) text: String,
}

/// One or (after includes) several files as one arena of elements; element 0 is the root of the first file.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Document {
    pub(crate) files: Vec<Source>,
    pub(crate) elements: Vec<Element>,
    /// Elements and attributes so far.
    items: usize,
}

/// A file that is being parsed.
struct OpenFile<'a> {
    name: &'a str,
    text: &'a str,
    /// Elements whose end tag has not come yet, from the root on.
    open: Vec<usize>,
    root: Option<usize>,
}

impl OpenFile<'_> {
    /// An error at a byte of the file.
    fn fail<T>(&self, offset: usize, problem: String, remedy: &str) -> Result<T> {
        Err(Error::content(
            Place::of_offset(self.name, self.text.as_bytes(), offset),
            problem,
            remedy,
        ))
    }

    /// Refuses document types and entities that they declare; other events pass.
    fn refuse_declarations(&self, event: &Event<'_>, offset: usize) -> Result<()> {
        match event {
            Event::DocType(_) => self.fail(
                offset,
                "it has a document type definition (<!DOCTYPE …>)".into(),
                "remove it: twincal reads neither DTDs nor external entities",
            ),
            Event::GeneralRef(entity) => {
                let known = entity.is_char_ref()
                    || quick_xml::escape::resolve_predefined_entity(entity).is_some();
                if known {
                    return Ok(());
                }
                self.fail(
                    offset,
                    format!(
                        "entity &{}; is not one of the five predefined ones",
                        shorten(entity)
                    ),
                    "write the text itself",
                )
            }
            _ => Ok(()),
        }
    }
}

impl Document {
    /// Parses `bytes` and appends its elements; returns the index of its root element.
    ///
    /// # Errors
    /// [`Error::Content`] with line and column for anything but well-formed UTF-8 XML within the limits, for DTDs and
    /// for entities other than the five predefined ones.
    pub(crate) fn parse(&mut self, name: &str, bytes: &[u8]) -> Result<usize> {
        let text = decode(name, bytes)?;
        // The reader drops a byte-order mark without counting it.
        let skip = if text.starts_with('\u{feff}') {
            '\u{feff}'.len_utf8()
        } else {
            0
        };
        let mut reader = Reader::from_str(&text[skip..]);
        let mut file = OpenFile {
            name,
            text: &text,
            open: Vec::new(),
            root: None,
        };
        loop {
            let offset = skip + reader.buffer_position() as usize;
            let event = match reader.read_event() {
                Ok(event) => event,
                Err(error) => {
                    return file.fail(
                        skip + reader.error_position() as usize,
                        format!("not well-formed XML: {error}"),
                        "correct the file",
                    );
                }
            };
            let behind = skip + reader.buffer_position() as usize;
            match event {
                Event::Start(ref tag) => {
                    let index = self.start(&mut file, tag, offset..behind)?;
                    file.open.push(index);
                }
                Event::Empty(ref tag) => {
                    self.start(&mut file, tag, offset..behind)?;
                }
                Event::End(_) => {
                    if let Some(closed) = file.open.pop() {
                        self.elements[closed].close = offset;
                        self.elements[closed].end = behind;
                    }
                }
                Event::Eof => break,
                ref other => file.refuse_declarations(other, offset)?,
            }
        }
        let root = self.root_of(&file)?;
        self.files.push(Source {
            name: name.into(),
            text,
        });
        Ok(root)
    }

    /// Appends the element of a start tag, `span` in its file; returns its index.
    fn start(
        &mut self,
        file: &mut OpenFile<'_>,
        tag: &BytesStart<'_>,
        span: Range<usize>,
    ) -> Result<usize> {
        let offset = span.start;
        if file.open.len() >= MAX_DEPTH {
            return file.fail(
                offset,
                format!("elements are nested deeper than {MAX_DEPTH} levels"),
                "no robot needs this: is it the right file?",
            );
        }
        let element = Element {
            name: tag.name().as_ref().into(),
            attributes: attributes(file, offset, tag)?,
            children: Vec::new(),
            file: self.files.len(),
            offset,
            inside: span.end,
            close: span.end,
            end: span.end,
        };
        self.items += 1 + element.attributes.len();
        if self.items > MAX_ITEMS {
            return file.fail(
                offset,
                format!("more than {MAX_ITEMS} elements and attributes"),
                "no robot needs this: is it the right file?",
            );
        }
        let index = self.elements.len();
        match file.open.last() {
            Some(&parent) => self.elements[parent].children.push(index),
            None if file.root.is_none() => file.root = Some(index),
            None => {
                return file.fail(
                    offset,
                    format!("a second root element <{}>", element.name),
                    "an XML file has one root element",
                );
            }
        }
        self.elements.push(element);
        Ok(index)
    }

    /// Root element of a file that has been read to its end.
    fn root_of(&self, file: &OpenFile<'_>) -> Result<usize> {
        if let Some(&unclosed) = file.open.last() {
            let element = &self.elements[unclosed];
            return file.fail(
                element.offset,
                format!("element <{}> is never closed", shorten(&element.name)),
                "the file ends too early: was it cut off?",
            );
        }
        file.root.ok_or_else(|| {
            Error::content(
                Place::file(file.name),
                "there is no XML element in it",
                "give a URDF or MJCF file",
            )
        })
    }

    /// Where an element begins.
    pub(crate) fn place(&self, element: &Element) -> Place {
        self.place_at(element.file, element.offset)
    }

    /// Line and column of a byte of a file.
    pub(crate) fn place_at(&self, file: usize, offset: usize) -> Place {
        let source = &self.files[file];
        Place::of_offset(source.name.as_str(), source.text.as_bytes(), offset)
    }

    /// Children with the given element name, in order.
    pub(crate) fn children<'a>(
        &'a self,
        element: &'a Element,
        name: &'a str,
    ) -> impl Iterator<Item = &'a Element> {
        element
            .children
            .iter()
            .map(|&c| &self.elements[c])
            .filter(move |c| c.name == name)
    }

    /// The first child of that name.
    pub(crate) fn child<'a>(&'a self, element: &'a Element, name: &'a str) -> Option<&'a Element> {
        self.children(element, name).next()
    }

    /// An error at an element.
    pub(crate) fn error(
        &self,
        element: &Element,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Error {
        Error::content(self.place(element), problem, remedy)
    }

    /// An error at an attribute's value.
    pub(crate) fn attribute_error(
        &self,
        element: &Element,
        attribute: &Attribute,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Error {
        Error::content(
            self.place_at(element.file, attribute.span.start),
            problem,
            remedy,
        )
    }

    /// `N` numbers of an attribute; `None` if it is absent. NaN and infinities pass: what they mean is for the caller.
    ///
    /// # Errors
    /// At the attribute when it is not exactly `N` numbers.
    pub(crate) fn numbers<const N: usize>(
        &self,
        element: &Element,
        name: &str,
    ) -> Result<Option<[f64; N]>> {
        element
            .get(name)
            .map(|attribute| self.exactly(element, attribute))
            .transpose()
    }

    /// The `N` numbers of an attribute of `element`.
    ///
    /// # Errors
    /// At the attribute when it is not exactly `N` numbers.
    pub(crate) fn exactly<const N: usize>(
        &self,
        element: &Element,
        attribute: &Attribute,
    ) -> Result<[f64; N]> {
        let values = self.number_list(element, attribute)?;
        match values[..].try_into() {
            Ok(array) => Ok(array),
            Err(_) => Err(self.attribute_error(
                element,
                attribute,
                format!(
                    "<{}> {}=\"{}\" has {} numbers",
                    element.name,
                    attribute.name,
                    shorten(&attribute.value),
                    values.len()
                ),
                format!("give {N}"),
            )),
        }
    }

    /// All numbers of an attribute (at most 64).
    pub(crate) fn number_list(&self, element: &Element, attribute: &Attribute) -> Result<Vec<f64>> {
        let mut values = Vec::new();
        for word in attribute.value.split_ascii_whitespace().take(64) {
            match word.parse::<f64>() {
                Ok(value) => values.push(value),
                Err(_) => {
                    return Err(self.attribute_error(
                        element,
                        attribute,
                        format!(
                            "<{}> {}: `{}` is not a number",
                            element.name,
                            attribute.name,
                            shorten(word)
                        ),
                        "write a decimal number with a point",
                    ));
                }
            }
        }
        Ok(values)
    }

    /// One number.
    pub(crate) fn number(&self, element: &Element, name: &str) -> Result<Option<f64>> {
        Ok(self.numbers::<1>(element, name)?.map(|[value]| value))
    }
}

impl Element {
    /// An attribute by name.
    pub(crate) fn get(&self, name: &str) -> Option<&Attribute> {
        self.attributes.iter().find(|a| a.name == name)
    }

    /// An attribute's value by name.
    pub(crate) fn text(&self, name: &str) -> Option<&str> {
        self.get(name).map(|a| a.value.as_str())
    }
}

/// At most 40 characters of a name or value for a message.
pub(crate) fn shorten(text: &str) -> String {
    if text.chars().count() <= 40 {
        text.into()
    } else {
        text.chars().take(39).chain(['…']).collect()
    }
}

/// The attributes of a tag that begins at byte `offset` of a file.
fn attributes(file: &OpenFile<'_>, offset: usize, tag: &BytesStart<'_>) -> Result<Vec<Attribute>> {
    let element = shorten(tag.name().as_ref());
    let tag_text: &str = tag;
    let mut list: Vec<Attribute> = Vec::new();
    // Our own check for duplicates: 64 attributes at most, so it stays cheap.
    for attribute in tag.attributes().with_checks(false) {
        let attribute = match attribute {
            Ok(attribute) => attribute,
            Err(error) => {
                let at = offset + 1 + attr_error_offset(&error).min(tag_text.len());
                return file.fail(
                    at,
                    format!("<{element}>: malformed attribute: {error}"),
                    "write name=\"value\"",
                );
            }
        };
        if list.len() >= MAX_ATTRIBUTES {
            return file.fail(
                offset,
                format!("<{element}> has more than {MAX_ATTRIBUTES} attributes"),
                "no robot needs this: is it the right file?",
            );
        }
        let QName(key) = attribute.key;
        let at = offset + 1 + position_in(tag_text, key);
        if list.iter().any(|a| a.name == key) {
            return file.fail(
                at,
                format!("<{element}> has attribute `{}` twice", shorten(key)),
                "remove one of them",
            );
        }
        let start = offset + 1 + position_in(tag_text, &attribute.value);
        let value = match attribute.normalized_value(XmlVersion::Implicit1_0) {
            Ok(value) => value.into_owned(),
            Err(error) => {
                return file.fail(
                    start,
                    format!("<{element}> {key}: {error}"),
                    "write the text itself",
                );
            }
        };
        list.push(Attribute {
            name: key.into(),
            value,
            span: start..start + attribute.value.len(),
        });
    }
    Ok(list)
}

/// Byte offset of `part` in `whole`, of which it is a slice (0 if it is not).
fn position_in(whole: &str, part: &str) -> usize {
    (part.as_ptr() as usize)
        .checked_sub(whole.as_ptr() as usize)
        .filter(|&p| p <= whole.len())
        .unwrap_or(0)
}

fn attr_error_offset(error: &AttrError) -> usize {
    match *error {
        AttrError::ExpectedEq(at)
        | AttrError::ExpectedValue(at)
        | AttrError::UnquotedValue(at)
        | AttrError::ExpectedQuote(at, _)
        | AttrError::Duplicated(at, _) => at,
    }
}

/// Text of a file that is small enough and UTF-8; other things that people give by mistake are named.
fn decode(name: &str, bytes: &[u8]) -> Result<String> {
    let fail =
        |problem: String, remedy: &str| Err(Error::content(Place::file(name), problem, remedy));
    if bytes.is_empty() {
        return fail("the file is empty".into(), "give a URDF or MJCF file");
    }
    if bytes.len() > MAX_BYTES {
        return too_large(name, bytes.len() as u64);
    }
    if bytes.starts_with(b"version https://git-lfs") {
        return fail(
            "this is a Git LFS pointer, not the model".into(),
            "fetch it with `git lfs pull`",
        );
    }
    if bytes.starts_with(&[0xFF, 0xFE]) || bytes.starts_with(&[0xFE, 0xFF]) {
        return fail("the file is UTF-16".into(), "save it as UTF-8");
    }
    if let Some(at) = bytes.iter().position(|byte| *byte == 0) {
        return Err(Error::content(
            Place::of_offset(name, bytes, at),
            "there is a NUL byte in the text",
            "save the file as UTF-8 text without it",
        ));
    }
    match std::str::from_utf8(bytes) {
        Ok(text) => Ok(text.into()),
        Err(error) => Err(Error::content(
            Place::of_offset(name, bytes, error.valid_up_to()),
            "the file is not UTF-8 text",
            "give a URDF or MJCF file saved as UTF-8",
        )),
    }
}

/// The error for a file beyond [`MAX_BYTES`].
pub(crate) fn too_large<T>(name: &str, bytes: u64) -> Result<T> {
    Err(Error::content(
        Place::file(name),
        format!(
            "the file has {:.1} MiB, more than the limit of {} MiB",
            bytes as f64 / 1048576.0,
            MAX_BYTES >> 20
        ),
        "a robot model without meshes is far smaller: is it the right file?",
    ))
}
