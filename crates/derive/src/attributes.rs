//! The attributes of serde and of `setting` that determine keys and forms.

use syn::{Attribute, LitStr, Result, Token, Type, meta::ParseNestedMeta};

/// A rule of serde for names.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) enum Rename {
    #[default]
    Unchanged,
    Kebab,
    Lower,
}

impl Rename {
    /// The name in a file: `min_points` and `MinPoints` become `min-points`.
    pub(crate) fn apply(self, name: &str) -> String {
        let name = name.trim_start_matches("r#");
        match self {
            Self::Unchanged => name.to_owned(),
            Self::Lower => name.to_lowercase(),
            Self::Kebab => {
                let mut kebab = String::new();
                for c in name.chars() {
                    if c.is_uppercase() && !kebab.is_empty() {
                        kebab.push('-');
                    }
                    kebab.extend(if c == '_' { vec!['-'] } else { c.to_lowercase().collect() });
                }
                kebab
            }
        }
    }
}

/// The attributes of a struct or an enum.
#[derive(Debug, Default)]
pub(crate) struct Container {
    pub(crate) fields: Rename,
    pub(crate) variants: Rename,
    pub(crate) default: bool,
    pub(crate) untagged: bool,
}

impl Container {
    pub(crate) fn read(attributes: &[Attribute]) -> Result<Self> {
        let mut found = Self::default();
        each(attributes, "serde", |meta| {
            if meta.path.is_ident("rename_all") {
                let rule: LitStr = meta.value()?.parse()?;
                let rule = match rule.value().as_str() {
                    "kebab-case" => Rename::Kebab,
                    "lowercase" => Rename::Lower,
                    other => return Err(meta.error(format!("no rule for the names `{other}`"))),
                };
                (found.fields, found.variants) = (rule, rule);
            } else if meta.path.is_ident("default") {
                found.default = true;
                skip(meta)?;
            } else if meta.path.is_ident("untagged") {
                found.untagged = true;
            } else if meta.path.is_ident("tag") || meta.path.is_ident("content") {
                return Err(meta.error("a tagged enum has no form"));
            } else {
                skip(meta)?;
            }
            Ok(())
        })?;
        Ok(found)
    }
}

/// The attributes of a field or a variant.
#[derive(Default)]
pub(crate) struct Options {
    pub(crate) rename: Option<String>,
    pub(crate) default: bool,
    /// Whether the table of a component may omit its name.
    pub(crate) nameless: bool,
    /// The kind of the chosen component.
    pub(crate) component: Option<String>,
    /// A type whose form the value has.
    pub(crate) form: Option<Type>,
}

impl Options {
    pub(crate) fn read(attributes: &[Attribute]) -> Result<Self> {
        let mut found = Self::default();
        each(attributes, "serde", |meta| {
            if meta.path.is_ident("rename") {
                found.rename = Some(meta.value()?.parse::<LitStr>()?.value());
            } else if meta.path.is_ident("default") {
                found.default = true;
                skip(meta)?;
            } else if meta.path.is_ident("deserialize_with") {
                // The readers of components supply the name that a table omits.
                found.nameless = true;
                skip(meta)?;
            } else if meta.path.is_ident("flatten") || meta.path.is_ident("skip") {
                return Err(meta.error("a flattened or skipped field has no form"));
            } else {
                skip(meta)?;
            }
            Ok(())
        })?;
        each(attributes, "setting", |meta| {
            if meta.path.is_ident("component") {
                found.component = Some(meta.value()?.parse::<LitStr>()?.value());
            } else if meta.path.is_ident("form") {
                found.form = Some(meta.value()?.parse()?);
            } else {
                return Err(meta.error("expected `component` or `form`"));
            }
            Ok(())
        })?;
        Ok(found)
    }
}

/// Reads every part of the attributes with this name.
fn each(attributes: &[Attribute], name: &str, mut read: impl FnMut(&ParseNestedMeta<'_>) -> Result<()>) -> Result<()> {
    let named = attributes.iter().filter(|attribute| attribute.path().is_ident(name));
    for attribute in named {
        attribute.parse_nested_meta(|meta| read(&meta))?;
    }
    Ok(())
}

/// Skips the value of a part, if it has one.
fn skip(meta: &ParseNestedMeta<'_>) -> Result<()> {
    if meta.input.peek(Token![=]) {
        let _: LitStr = meta.value()?.parse()?;
    }
    Ok(())
}
