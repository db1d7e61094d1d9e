//! Merging of the shards of a run.

use std::path::{Path, PathBuf};

use seafix_component::Fault;

use crate::run::{
    assemble,
    folder::{self, Claim},
    manifest::{self, Manifest},
    observer::Observer,
    options::Options,
    outcome::{Finished, RunError},
    store::{Sealed, Store},
};

/// Joins the shards in `folders` into a run in the folder of `options`. Except for durations, the bytes are those of an
/// undivided run. Shards may come from different machines and from different divisions of the run.
///
/// # Errors
/// [`RunError`]: folders without shards, shards of different runs, missing or damaged pieces, or an output that cannot
/// be written.
pub fn merge(folders: &[PathBuf], options: &Options, observer: &dyn Observer) -> Result<Finished, RunError> {
    folder::inspect(options).map_err(RunError::Output)?;
    folder::input_inside(options, folders.iter().cloned()).map_err(RunError::Output)?;
    let (mut manifest, pieces) = gather(folders).map_err(|fault| RunError::Input(vec![fault]))?;
    manifest.shard = None;
    let name = folders
        .first()
        .and_then(|folder| folder.file_name())
        .map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let claim = Claim::new(options, &name, &manifest)?;
    if let Some(finished) = claim.finished {
        return Ok(Finished { folder: claim.folder, rows: finished.rows, kept: true });
    }
    manifest.write(&claim.folder, "running")?;
    if !assemble::assemble(&claim.folder, &mut manifest, &pieces, &options.pool()?, observer)? {
        manifest.write(&claim.folder, "interrupted")?;
        return Err(RunError::Interrupted(claim.folder));
    }
    manifest.write(&claim.folder, "finished")?;
    Ok(Finished { folder: claim.folder, rows: manifest.rows, kept: false })
}

/// The common manifest of the shards, and all their pieces.
fn gather(folders: &[PathBuf]) -> Result<(Manifest, Vec<Sealed>), Fault> {
    let mut first: Option<(&Path, Manifest)> = None;
    let mut pieces: Vec<Option<Sealed>> = Vec::new();
    let mut damaged: Vec<(usize, PathBuf)> = Vec::new();
    for folder in folders {
        let manifest = Manifest::read(folder)?;
        let file = folder.join(manifest::NAME);
        if manifest.state != "shard" {
            let fault = Fault::new("not a finished shard", &file).value(format!("a run, {}", manifest.state));
            return Err(fault.remedy("make it with `seafix run --shard k/n`, or resume it with --resume"));
        }
        match &first {
            None => {
                pieces.resize(manifest.pieces, None);
                first = Some((folder, manifest));
            }
            Some((other, known)) => {
                if let Some(what) = known.differs(&manifest) {
                    let fault = Fault::new("shards of different runs", &file).value(format!("{what} differs"));
                    return Err(fault.remedy(format!("merge shards of one run; compare with {}", other.display())));
                }
            }
        }
        for sealed in Store::of(folder).all() {
            if let Some(place) = pieces.get_mut(sealed.seal.piece) {
                place.get_or_insert(sealed);
            }
        }
        damaged.extend(Store::of(folder).damaged());
    }
    let Some((_, manifest)) = first else {
        return Err(Fault::new("no shards", Path::new("the command line")).remedy("name their folders"));
    };
    let missing: Vec<usize> = (0..pieces.len()).filter(|&number| pieces[number].is_none()).collect();
    if let Some(piece) = damaged.iter().find(|(number, _)| missing.contains(number)) {
        let fault =
            Fault::new("a damaged piece", &piece.1).value(format!("{} of {} are missing", missing.len(), pieces.len()));
        return Err(fault.remedy("make its shard again with --resume"));
    }
    if let Some(number) = missing.first() {
        let what = format!("{} of {} pieces are missing in the folders", missing.len(), pieces.len());
        // Pieces do not record their shard, but shards are dealt in turn.
        let of = manifest.shard.as_deref().and_then(|shard| shard.split_once('/')?.1.parse::<usize>().ok());
        let shard = of.map_or_else(String::new, |of| format!(", of shard {}/{of}", number % of + 1));
        return Err(Fault::new(what, Path::new("the command line"))
            .value(format!("the first is {number}{shard}"))
            .remedy("name the folders of all shards"));
    }
    Ok((manifest, pieces.into_iter().flatten().collect()))
}
