//! Fields of messages.

/// What a message lacks to be a record.
#[derive(Debug)]
pub(crate) struct Malformed(pub(crate) String);

/// The numbers of a matrix, row by row.
pub(super) fn flat<const R: usize, const C: usize>(matrix: &[[f64; C]; R]) -> Vec<f64> {
    matrix.as_flattened().to_vec()
}

/// The matrix of these numbers, row by row.
pub(super) fn matrix<const R: usize, const C: usize>(name: &str, numbers: &[f64]) -> Result<[[f64; C]; R], Malformed> {
    let mut rows = [[0.0; C]; R];
    if numbers.len() != R * C {
        return Err(Malformed(format!("{name} has {} numbers instead of {}", numbers.len(), R * C)));
    }
    for (row, numbers) in rows.iter_mut().zip(numbers.chunks_exact(C)) {
        row.copy_from_slice(numbers);
    }
    Ok(rows)
}

/// The same, where an empty list stands for none.
pub(super) fn matrix_if_any<const R: usize, const C: usize>(
    name: &str,
    numbers: &[f64],
) -> Result<Option<[[f64; C]; R]>, Malformed> {
    if numbers.is_empty() { Ok(None) } else { matrix(name, numbers).map(Some) }
}

/// The content of a field that must be there.
pub(super) fn required<T>(name: &str, field: Option<T>) -> Result<T, Malformed> {
    field.ok_or_else(|| Malformed(format!("{name} is missing")))
}
