//! Derive macro of `bevy_taw`.

use proc_macro::TokenStream;
use quote::{ToTokens, quote};
use syn::spanned::Spanned;
use syn::{Data, DeriveInput, Error, Fields, Ident, parse_macro_input};

/// Number of collision layers: bits of a mask.
const MAX_LAYERS: usize = 32;

/// Makes collision layers of the variants of an enum, in their order.
#[proc_macro_derive(PhysicsLayer)]
pub fn derive_physics_layer(input: TokenStream) -> TokenStream {
    let input = parse_macro_input!(input as DeriveInput);
    match layers(&input) {
        Ok(layers) => layers.to_token_stream().into(),
        Err(error) => error.into_compile_error().into(),
    }
}

/// Implementation of the trait for an enum.
fn layers(input: &DeriveInput) -> Result<impl ToTokens + use<>, Error> {
    let (name, variants) = (&input.ident, variants(input)?);
    let (impl_generics, type_generics, where_clause) = input.generics.split_for_impl();
    let bits = 0..variants.len() as u32;
    Ok(quote! {
        impl #impl_generics ::bevy_taw::layers::PhysicsLayer for #name #type_generics #where_clause {
            fn to_bits(&self) -> u32 {
                match self {
                    #(Self::#variants => 1 << #bits,)*
                }
            }
        }
    })
}

/// Names of the variants, if they can be layers.
fn variants(input: &DeriveInput) -> Result<Vec<&Ident>, Error> {
    let Data::Enum(data) = &input.data else {
        return Err(Error::new(input.ident.span(), "only an enum can be a PhysicsLayer"));
    };
    if data.variants.is_empty() || data.variants.len() > MAX_LAYERS {
        let reason = format!("a PhysicsLayer has 1 to {MAX_LAYERS} variants");
        return Err(Error::new(input.ident.span(), reason));
    }
    let variants = data.variants.iter().map(|variant| match variant.fields {
        Fields::Unit => Ok(&variant.ident),
        _ => Err(Error::new(variant.fields.span(), "a layer has no fields")),
    });
    variants.collect()
}
