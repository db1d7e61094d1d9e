//! The border at which a panic of a decoder becomes an error.

use std::{
    any::Any,
    cell::Cell,
    panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook},
    path::Path,
    sync::Once,
};

use crate::fault::Fault;

thread_local! {
    /// Whether this thread decodes foreign bytes.
    static DECODES: Cell<bool> = const { Cell::new(false) };
}

/// Decodes foreign bytes; a panic becomes its message.
///
/// Decoders of other people have panicked on damaged files. One damaged file must not end a run over many, and a panic
/// is no message for a user. The panic is not printed.
///
/// # Errors
/// The error of `decode`, or the message of its panic by `error`.
pub fn decoded<T, E>(decode: impl FnOnce() -> Result<T, E>, error: impl FnOnce(String) -> E) -> Result<T, E> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = take_hook();
        set_hook(Box::new(move |panic| {
            if !DECODES.get() {
                before(panic);
            }
        }));
    });
    let outer = DECODES.replace(true);
    // A decoder owns what it works on; nothing half-made is seen afterwards.
    let result = catch_unwind(AssertUnwindSafe(decode));
    DECODES.set(outer);
    result.unwrap_or_else(|panic| Err(error(message(&*panic))))
}

/// Decodes the file `file`; a panic becomes a fault of it.
///
/// # Errors
/// The fault of `decode`, or that of a panic.
pub fn decoded_file<T>(file: &Path, decode: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    decoded(decode, |message| undecodable(file, message))
}

/// The fault of a file whose decoder panicked.
pub fn undecodable(file: &Path, message: String) -> Fault {
    Fault::new("a damaged file that its decoder does not survive", file)
        .value(message)
        .remedy("copy the file again, or write it with another program")
}

fn message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "a panic without a message".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fails without the border: the test itself panics.
    #[test]
    fn a_panic_is_a_fault_of_the_file() {
        let file = Path::new("a.png");
        let none: [u8; 0] = [];
        let index = none.len() + 3;
        let fault = decoded_file(file, || Ok([1, 2, 3][index])).unwrap_err();
        assert!(fault.file == file && fault.value.contains("index out of bounds"), "{fault}");
        assert_eq!(decoded_file(file, || Ok(7)).unwrap(), 7);
        // A border within another one leaves the outer one in place.
        let outer = decoded(
            || {
                decoded(|| -> Result<u8, String> { panic!("inner") }, |text| text)
                    .map_err(|_| -> String { panic!("outer {index}") })
            },
            |text: String| text,
        );
        assert_eq!(outer, Err("outer 3".to_owned()));
    }
}
