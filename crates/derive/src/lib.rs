//! `#[derive(Settings)]`: the documented form of settings, from the attributes that a struct has anyway.
//!
//! The key of a field follows from serde's attributes and its sentence from the documentation comment. A field without
//! a comment does not compile. `seafix_component::Settings` describes the trait and the attribute `setting`.

mod attributes;
mod doc;

use proc_macro::TokenStream;
use proc_macro2::TokenStream as Tokens;
use quote::{ToTokens, quote};
use syn::{Data, DataEnum, DeriveInput, Error, Field, Fields, Result, Variant, parse_macro_input};

use crate::{
    attributes::{Container, Options, Rename},
    doc::documentation,
};

/// Implements `seafix_component::Settings` for a struct or an enum that serde deserialises.
#[proc_macro_derive(Settings, attributes(setting, serde))]
pub fn settings(input: TokenStream) -> TokenStream {
    let input = parse_macro_input!(input as DeriveInput);
    implemented(&input).unwrap_or_else(Error::into_compile_error).into()
}

fn implemented(input: &DeriveInput) -> Result<Tokens> {
    let container = Container::read(&input.attrs)?;
    let form = match &input.data {
        Data::Struct(data) => match &data.fields {
            // One unnamed field: serde's form is that of the field.
            Fields::Unnamed(fields) if fields.unnamed.len() == 1 => form_of(&fields.unnamed[0])?,
            fields => table(fields, &container)?,
        },
        Data::Enum(data) => alternatives(data, &container)?,
        Data::Union(_) => return Err(Error::new_spanned(&input.ident, "a union has no settings")),
    };
    let name = &input.ident;
    let choices = match &input.data {
        Data::Struct(data) => choices(&data.fields, &container)?,
        _ => Vec::new(),
    };
    let choices = (!choices.is_empty()).then(|| {
        quote! {
            fn choices(&mut self) -> Vec<::seafix_component::Chosen<'_>> {
                let mut all = Vec::new();
                #(#choices)*
                all
            }
        }
    });
    Ok(quote! {
        impl ::seafix_component::Settings for #name {
            fn form() -> ::seafix_component::Form { #form }
            #choices
        }
    })
}

/// The statements that add the choices of each field to `all`.
fn choices(fields: &Fields, container: &Container) -> Result<Vec<Tokens>> {
    let mut statements = Vec::new();
    for field in fields {
        let (Some(ident), Some(kind)) = (&field.ident, kind_of(field)?) else { continue };
        let Options { rename, .. } = Options::read(&field.attrs)?;
        let key = rename.unwrap_or_else(|| container.fields.apply(&ident.to_string()));
        let chosen = |place: Tokens, choice: Tokens| quote!(::seafix_component::Chosen { key: #key, kind: #kind, place: #place, choice: #choice });
        statements.push(if field.ty.to_token_stream().to_string() == "Choice" {
            let one = chosen(quote!(None), quote!(&mut self.#ident));
            quote!(all.push(#one);)
        } else {
            let each = chosen(quote!(Some(place)), quote!(choice));
            quote!(all.extend(self.#ident.iter_mut().enumerate().map(|(place, choice)| #each));)
        });
    }
    Ok(statements)
}

/// The kind of component that a field chooses: its key, `solver`, or its singular, `filters`, unless stated.
fn kind_of(field: &Field) -> Result<Option<String>> {
    let written = field.ty.to_token_stream().to_string();
    let (Some(ident), "Choice" | "Vec < Choice >") = (&field.ident, written.as_str()) else { return Ok(None) };
    let key = Rename::Kebab.apply(&ident.to_string());
    Ok(Some(Options::read(&field.attrs)?.component.unwrap_or_else(|| key.trim_end_matches('s').to_owned())))
}

/// The form of a table with these fields.
fn table(fields: &Fields, container: &Container) -> Result<Tokens> {
    let fields = fields.iter().map(|field| one(field, container)).collect::<Result<Vec<_>>>()?;
    Ok(quote!(::seafix_component::Form::Table(vec![#(#fields),*])))
}

/// One field of a table.
fn one(field: &Field, container: &Container) -> Result<Tokens> {
    let Some(ident) = &field.ident else { return Err(Error::new_spanned(field, "a setting needs a name")) };
    let Options { rename, default, .. } = Options::read(&field.attrs)?;
    let key = rename.unwrap_or_else(|| container.fields.apply(&ident.to_string()));
    let doc = documentation(&field.attrs);
    if doc.is_empty() {
        return Err(Error::new_spanned(ident, format!("the setting `{key}` has no documentation comment")));
    }
    let form = form_of(field)?;
    let required = !(default || container.default);
    Ok(quote!(::seafix_component::Field::new(#key, #doc, #form, #required)))
}

/// The form of a field's value.
fn form_of(field: &Field) -> Result<Tokens> {
    let options = Options::read(&field.attrs)?;
    if let Some(kind) = kind_of(field)? {
        let nameless = options.nameless;
        let choice = quote!(::seafix_component::Form::component(#kind, #nameless));
        let single = field.ty.to_token_stream().to_string() == "Choice";
        return Ok(if single { choice } else { quote!(::seafix_component::Form::list(#choice)) });
    }
    let of = options.form.as_ref().unwrap_or(&field.ty);
    Ok(quote!(<#of as ::seafix_component::Settings>::form()))
}

/// The form of an enum: words, tables of one key, or, untagged, the forms of the variants.
fn alternatives(data: &DataEnum, container: &Container) -> Result<Tokens> {
    let (mut words, mut others) = (Vec::new(), Vec::new());
    for variant in &data.variants {
        let Options { rename, .. } = Options::read(&variant.attrs)?;
        let key = rename.unwrap_or_else(|| container.variants.apply(&variant.ident.to_string()));
        let doc = documented(variant, &key)?;
        let value = match &variant.fields {
            Fields::Unit => {
                words.push(quote!((#key, #doc)));
                continue;
            }
            Fields::Unnamed(fields) if fields.unnamed.len() == 1 => form_of(&fields.unnamed[0])?,
            fields => table(fields, container)?,
        };
        others.push(if container.untagged {
            value
        } else {
            quote!(::seafix_component::Form::Table(vec![::seafix_component::Field::new(#key, #doc, #value, true)]))
        });
    }
    Ok(match (words.is_empty(), others.is_empty()) {
        (_, true) => quote!(::seafix_component::Form::Words(vec![#(#words),*])),
        (true, false) => quote!(::seafix_component::Form::OneOf(vec![#(#others),*])),
        (false, false) => {
            quote!(::seafix_component::Form::OneOf(
                vec![::seafix_component::Form::Words(vec![#(#words),*]), #(#others),*]
            ))
        }
    })
}

fn documented(variant: &Variant, key: &str) -> Result<String> {
    let doc = documentation(&variant.attrs);
    if doc.is_empty() {
        return Err(Error::new_spanned(&variant.ident, format!("the word `{key}` has no documentation comment")));
    }
    Ok(doc)
}
