//! File names in the two normal forms of Unicode.
//!
//! One letter with a mark may be written as one character (NFC, most systems) or as a letter and a combining mark (NFD,
//! files that were on macOS). A table and a folder may differ in that.

use std::path::{Path, PathBuf};

/// The letters with marks of Latin scripts, and each as a letter or a marked letter with one mark.
const COMPOSED: &str = "ÀÁÂÃÄÅÇÈÉÊËÌÍÎÏÑÒÓÔÕÖÙÚÛÜÝàáâãäåçèéêëìíîïñòóôõöùúûüýÿĀāĂăĄąĆćĈĉĊċČčĎďĒēĔĕĖėĘęĚěĜĝĞğĠġĢģĤĥĨĩĪīĬĭĮ\
     įİĴĵĶķĹĺĻļĽľŃńŅņŇňŌōŎŏŐőŔŕŖŗŘřŚśŜŝŞşŠšŢţŤťŨũŪūŬŭŮůŰűŲųŴŵŶŷŸŹźŻżŽžǍǎǏǐǑǒǓǔǕǖǗǘǙǚǛǜḀḁḂḃḄḅḆḇḈḉḊḋḌḍḎ\
     ḏḐḑḒḓḔḕḖḗḘḙḚḛḜḝḞḟḠḡḢḣḤḥḦḧḨḩḪḫḬḭḮḯḰḱḲḳḴḵḶḷḸḹḺḻḼḽḾḿṀṁṂṃṄṅṆṇṈṉṊṋṌṍṎṏṐṑṒṓṔṕṖṗṘṙṚṛṜṝṞṟṠṡṢṣṤṥṦṧṨṩṪṫṬṭṮ\
     ṯṰṱṲṳṴṵṶṷṸṹṺṻṼṽṾṿẀẁẂẃẄẅẆẇẈẉẊẋẌẍẎẏẐẑẒẓẔẕẖẗẘẙẛẠạẢảẤấẦầẨẩẪẫẬậẮắẰằẲẳẴẵẶặẸẹẺẻẼẽẾếỀềỂểỄễỆệỈỉỊịỌọỎỏỐốỒồ\
     ỔổỖỗỘộỚớỜờỞởỠỡỢợỤụỦủỨứỪừỬửỮữỰựỲỳỴỵỶỷỸỹ";
const DECOMPOSED: &str = "A\u{300}A\u{301}A\u{302}A\u{303}A\u{308}A\u{30a}C\u{327}E\u{300}E\u{301}E\u{302}E\u{308}I\u{300}\
     I\u{301}I\u{302}I\u{308}N\u{303}O\u{300}O\u{301}O\u{302}O\u{303}O\u{308}U\u{300}U\u{301}U\u{302}\
     U\u{308}Y\u{301}a\u{300}a\u{301}a\u{302}a\u{303}a\u{308}a\u{30a}c\u{327}e\u{300}e\u{301}e\u{302}\
     e\u{308}i\u{300}i\u{301}i\u{302}i\u{308}n\u{303}o\u{300}o\u{301}o\u{302}o\u{303}o\u{308}u\u{300}\
     u\u{301}u\u{302}u\u{308}y\u{301}y\u{308}A\u{304}a\u{304}A\u{306}a\u{306}A\u{328}a\u{328}C\u{301}\
     c\u{301}C\u{302}c\u{302}C\u{307}c\u{307}C\u{30c}c\u{30c}D\u{30c}d\u{30c}E\u{304}e\u{304}E\u{306}\
     e\u{306}E\u{307}e\u{307}E\u{328}e\u{328}E\u{30c}e\u{30c}G\u{302}g\u{302}G\u{306}g\u{306}G\u{307}\
     g\u{307}G\u{327}g\u{327}H\u{302}h\u{302}I\u{303}i\u{303}I\u{304}i\u{304}I\u{306}i\u{306}I\u{328}\
     i\u{328}I\u{307}J\u{302}j\u{302}K\u{327}k\u{327}L\u{301}l\u{301}L\u{327}l\u{327}L\u{30c}l\u{30c}\
     N\u{301}n\u{301}N\u{327}n\u{327}N\u{30c}n\u{30c}O\u{304}o\u{304}O\u{306}o\u{306}O\u{30b}o\u{30b}\
     R\u{301}r\u{301}R\u{327}r\u{327}R\u{30c}r\u{30c}S\u{301}s\u{301}S\u{302}s\u{302}S\u{327}s\u{327}\
     S\u{30c}s\u{30c}T\u{327}t\u{327}T\u{30c}t\u{30c}U\u{303}u\u{303}U\u{304}u\u{304}U\u{306}u\u{306}\
     U\u{30a}u\u{30a}U\u{30b}u\u{30b}U\u{328}u\u{328}W\u{302}w\u{302}Y\u{302}y\u{302}Y\u{308}Z\u{301}\
     z\u{301}Z\u{307}z\u{307}Z\u{30c}z\u{30c}A\u{30c}a\u{30c}I\u{30c}i\u{30c}O\u{30c}o\u{30c}U\u{30c}\
     u\u{30c}Ü\u{304}ü\u{304}Ü\u{301}ü\u{301}Ü\u{30c}ü\u{30c}Ü\u{300}ü\u{300}A\u{325}a\u{325}B\u{307}\
     b\u{307}B\u{323}b\u{323}B\u{331}b\u{331}Ç\u{301}ç\u{301}D\u{307}d\u{307}D\u{323}d\u{323}D\u{331}\
     d\u{331}D\u{327}d\u{327}D\u{32d}d\u{32d}Ē\u{300}ē\u{300}Ē\u{301}ē\u{301}E\u{32d}e\u{32d}E\u{330}\
     e\u{330}Ȩ\u{306}ȩ\u{306}F\u{307}f\u{307}G\u{304}g\u{304}H\u{307}h\u{307}H\u{323}h\u{323}H\u{308}\
     h\u{308}H\u{327}h\u{327}H\u{32e}h\u{32e}I\u{330}i\u{330}Ï\u{301}ï\u{301}K\u{301}k\u{301}K\u{323}\
     k\u{323}K\u{331}k\u{331}L\u{323}l\u{323}Ḷ\u{304}ḷ\u{304}L\u{331}l\u{331}L\u{32d}l\u{32d}M\u{301}\
     m\u{301}M\u{307}m\u{307}M\u{323}m\u{323}N\u{307}n\u{307}N\u{323}n\u{323}N\u{331}n\u{331}N\u{32d}\
     n\u{32d}Õ\u{301}õ\u{301}Õ\u{308}õ\u{308}Ō\u{300}ō\u{300}Ō\u{301}ō\u{301}P\u{301}p\u{301}P\u{307}\
     p\u{307}R\u{307}r\u{307}R\u{323}r\u{323}Ṛ\u{304}ṛ\u{304}R\u{331}r\u{331}S\u{307}s\u{307}S\u{323}\
     s\u{323}Ś\u{307}ś\u{307}Š\u{307}š\u{307}Ṣ\u{307}ṣ\u{307}T\u{307}t\u{307}T\u{323}t\u{323}T\u{331}\
     t\u{331}T\u{32d}t\u{32d}U\u{324}u\u{324}U\u{330}u\u{330}U\u{32d}u\u{32d}Ũ\u{301}ũ\u{301}Ū\u{308}\
     ū\u{308}V\u{303}v\u{303}V\u{323}v\u{323}W\u{300}w\u{300}W\u{301}w\u{301}W\u{308}w\u{308}W\u{307}\
     w\u{307}W\u{323}w\u{323}X\u{307}x\u{307}X\u{308}x\u{308}Y\u{307}y\u{307}Z\u{302}z\u{302}Z\u{323}\
     z\u{323}Z\u{331}z\u{331}h\u{331}t\u{308}w\u{30a}y\u{30a}ſ\u{307}A\u{323}a\u{323}A\u{309}a\u{309}\
     Â\u{301}â\u{301}Â\u{300}â\u{300}Â\u{309}â\u{309}Â\u{303}â\u{303}Ạ\u{302}ạ\u{302}Ă\u{301}ă\u{301}\
     Ă\u{300}ă\u{300}Ă\u{309}ă\u{309}Ă\u{303}ă\u{303}Ạ\u{306}ạ\u{306}E\u{323}e\u{323}E\u{309}e\u{309}\
     E\u{303}e\u{303}Ê\u{301}ê\u{301}Ê\u{300}ê\u{300}Ê\u{309}ê\u{309}Ê\u{303}ê\u{303}Ẹ\u{302}ẹ\u{302}\
     I\u{309}i\u{309}I\u{323}i\u{323}O\u{323}o\u{323}O\u{309}o\u{309}Ô\u{301}ô\u{301}Ô\u{300}ô\u{300}\
     Ô\u{309}ô\u{309}Ô\u{303}ô\u{303}Ọ\u{302}ọ\u{302}Ơ\u{301}ơ\u{301}Ơ\u{300}ơ\u{300}Ơ\u{309}ơ\u{309}\
     Ơ\u{303}ơ\u{303}Ơ\u{323}ơ\u{323}U\u{323}u\u{323}U\u{309}u\u{309}Ư\u{301}ư\u{301}Ư\u{300}ư\u{300}\
     Ư\u{309}ư\u{309}Ư\u{303}ư\u{303}Ư\u{323}ư\u{323}Y\u{300}y\u{300}Y\u{323}y\u{323}Y\u{309}y\u{309}\
     Y\u{303}y\u{303}";

/// A name in decomposed form.
fn decomposed(name: &str) -> String {
    let split = |letter: char| {
        let at = COMPOSED.chars().position(|composed| composed == letter)?;
        let mut parts = DECOMPOSED.chars().skip(2 * at);
        Some((parts.next()?, parts.next()?))
    };
    let mut all = String::with_capacity(name.len());
    for letter in name.chars() {
        let (mut base, mut marks) = (letter, Vec::new());
        while let Some((inner, mark)) = split(base).filter(|_| !base.is_ascii()) {
            base = inner;
            marks.push(mark);
        }
        all.push(base);
        all.extend(marks.iter().rev());
    }
    all
}

/// The file at `path`, or the only one beside it whose name has the same letters in the other normal form.
pub(super) fn found(path: &Path) -> PathBuf {
    let (Some(folder), Some(name)) = (path.parent(), path.file_name().and_then(|name| name.to_str())) else {
        return path.to_owned();
    };
    if name.is_ascii() || path.exists() {
        return path.to_owned();
    }
    let wanted = decomposed(name);
    let entries = std::fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok).map(|entry| entry.path());
    let mut same = entries.filter(|other| {
        other
            .file_name()
            .and_then(|name| name.to_str())
            .is_some_and(|name| !name.is_ascii() && decomposed(name) == wanted)
    });
    match (same.next(), same.next()) {
        (Some(only), None) => only,
        _ => path.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_found_in_either_form() {
        assert_eq!(COMPOSED.chars().count() * 2, DECOMPOSED.chars().count());
        assert_eq!(decomposed("Tauchgänge_ế"), "Tauchga\u{308}nge_e\u{302}\u{301}");
        let folder = tempfile::tempdir().unwrap();
        for (listed, stored) in [("gänge.png", "ga\u{308}nge.png"), ("o\u{301}.png", "ó.png")] {
            std::fs::write(folder.path().join(stored), b"x").unwrap();
            assert_eq!(found(&folder.path().join(listed)), folder.path().join(stored));
        }
        let missing = folder.path().join("gange.png");
        assert_eq!(found(&missing), missing);
    }
}
