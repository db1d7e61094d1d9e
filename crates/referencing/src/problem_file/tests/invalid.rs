//! Invalid files are reported with element, place, value and remedy.

use super::*;

#[test]
fn every_fault_names_its_place() {
    let sigmas = "\"sigma\": 0.01, \"sigma_xyz\": ";
    for (from, to, expected) in [
        ("problem/1", "problem/2", "unknown format in p.json:1:12: `coherence-problem/2`; this reader supports"),
        ("problem/1\"", "problem/1.2\", \"new\": 1", "unknown format in p.json:1:12: `coherence-problem/1.2`; this"),
        ("0.04", "-1", "`delta` is out of range in p.json:4:25: -1; allowed: above 0, at most"),
        ("0.04", "2.0", "`delta` is out of range in p.json:4:25: 2.0; allowed"),
        ("0.04", "1e300", "`delta` is out of range in p.json:4:25: 1e300; allowed"),
        // The third and the fourth point are 1.6202 m apart, the diagonal of the bounding box is 2.19 m.
        (
            "0.04",
            "0.82",
            "`delta` is out of range in p.json:4:25: 0.82; allowed: above 0, at most half the model's diameter, 0.8101 m",
        ),
        ("0.01", "-0.01", "`sigma` is out of range in p.json:4:10: -0.01; give metres, zero to 1e15"),
        ("0.01", "1e300", "`sigma` is out of range in p.json:4:10: 1e300; give metres"),
        ("[0.5,0.5,1]", "[0.5, 1e10, 1]", "model point 3 is out of range in p.json:2:42: [0.5, 1e10, 1]; give"),
        (
            "null}",
            "[[0,5]]}",
            "putative pair 0 is out of range in p.json:6:14: [0,5]; there are 5 model and 5 cloud points",
        ),
        (
            "\"sigma\": 0.01",
            &format!("{sigmas}[[1,1,1]]"),
            "`sigma_xyz` has the wrong length in p.json:4:29: 1 row for 5 cloud",
        ),
        (
            "\"sigma\": 0.01",
            &format!("{sigmas}[[1,1,1],[1,1,1],[1,1,1],[1,-1,1],[1,1,1]]"),
            "row 3 of `sigma_xyz` is out of range in p.json:4:54: [1,-1,1]; give metres",
        ),
        ("[[1,0,0,0.05]", "[[1.1,0,0,0.05]", "`prior.T_cam_obj` is not a rigid motion: "),
        ("0.1}", "0}", "`prior.shell_half_m` is out of range in p.json:5:86: 0; give a positive half-size in metres"),
        (
            "{\"format\"",
            "[\"format\"",
            "a list instead of an object in p.json:1:1: `[`; give one `coherence-problem/1` per file, in braces",
        ),
    ] {
        let reported = fault(from, to);
        assert!(reported.starts_with(expected), "{expected}\n{reported}");
    }
    assert!(fault("[[1,0,0,0.05]", "[[1.1,0,0,0.05]").contains("in p.json:5:24: [[1.1,"));
    assert!(parse(&GOOD.replacen("0.04", "0.81", 1)).is_ok());
}

/// A value of the wrong type is reported with its element, place, text and remedy.
#[test]
fn every_value_of_another_kind_is_named() {
    let number = "; give a number, in metres";
    let row = "; give three numbers x y z, in metres";
    for (from, to, expected) in [
        ("[0.5,0.5,1]", "[0.5,\"a, b\",1]", format!("`model[3][1]` is not a number in p.json:2:47: \"a, b\"{number}")),
        ("[0.5,0.5,4]", "[0.5,null,4]", format!("`cloud[3][1]` is not a number in p.json:3:47: null{number}")),
        (
            "[0.5,0.5,1]",
            "[0.5,1e999,1]",
            format!("`model[3][1]` is too large for a number in p.json:2:47: 1e999{number}"),
        ),
        ("[0.5,0.5,1]", "[0.5,1]", format!("`model[3]` has 2 values in p.json:2:42: [0.5,1]{row}")),
        ("[0.5,0.5,1]", "[0.5,1,2,3]", format!("`model[3]` has 4 values in p.json:2:42: [0.5,1,2,3]{row}")),
        ("[0.5,0.5,1]", "7", format!("`model[3]` is not a point in p.json:2:42: 7{row}")),
        (
            "0.01",
            "\"1 cm\"",
            "`sigma` is not a number in p.json:4:10: \"1 cm\"; give the standard deviation".to_owned(),
        ),
        (
            "0.01",
            "0.01, \"sigma_xyz\": 1",
            "`sigma_xyz` is not a list of rows in p.json:4:29: 1; give null, or".to_owned(),
        ),
        (
            "0.05",
            "\"x\"",
            "`prior.T_cam_obj[0][3]` is not a number in p.json:5:32: \"x\"; give a number; the".to_owned(),
        ),
        (
            ",[0,0,0,1]]",
            "]",
            "`prior.T_cam_obj` has 3 values in p.json:5:24: [[1,0,0,0.05],[0,1,0,0],[0,0,1,3]]; give a 4×4".to_owned(),
        ),
        (
            "[[1,0,0,0.05]",
            "[[1,0,0]",
            "`prior.T_cam_obj[0]` has 3 values in p.json:5:25: [1,0,0]; give four".to_owned(),
        ),
        (
            GOOD_PRIOR,
            "[[[1,0,0,0],[0,1,0,0],[0,0,1,3],[0,0,0,1]],1]",
            "`prior` is not an object in p.json:5:10: [[[1,0,0,0]".to_owned(),
        ),
        (
            "null}",
            "[[0,-1]]}",
            "`putative[0][1]` is not an index in p.json:6:17: -1; give a whole number, counted from 0".to_owned(),
        ),
        ("null}", "[[0,0],[1.5,0]]}", "`putative[1][0]` is not an index in p.json:6:21: 1.5; give a whole".to_owned()),
        (
            "null}",
            "[[0]]}",
            "`putative[0]` has 1 value in p.json:6:14: [0]; give two indices [model, cloud]".to_owned(),
        ),
        ("\"x\"", "5", "`id` is not a string in p.json:1:41: 5; give a name in double quotes, or null".to_owned()),
    ] {
        let reported = fault(from, to);
        assert!(reported.starts_with(&expected), "{expected}\n{reported}");
    }
}

/// Missing, unknown and duplicate keys, and invalid JSON.
#[test]
fn every_text_that_is_no_problem_is_reported_with_its_place() {
    for (from, to, expected) in [
        ("\"delta\"", "\"delat\"", "unknown key in p.json:4:16: `delat`; did you mean `delta`?"),
        ("\"delta\"", "\"a\"", "unknown key in p.json:4:16: `a`; there are format, id, "),
        ("\"delta\"", "\"del`ta\"", "unknown key in p.json:4:16: `del`ta`; did you mean `delta`?"),
        ("0.01, ", "0.01 m, ", "expected `,` or `}` in p.json:4:"),
        ("\"shell_half_m\"", "\"shell\"", "unknown key in p.json:5:70: `shell`; "),
        (
            "\"sigma\": 0.01, ",
            "",
            "`sigma` is missing in p.json:1:1; give the standard deviation of a measured coordinate",
        ),
        (", \"shell_half_m\": 0.1", "", "`prior.shell_half_m` is missing in p.json:5:10; give the half-size"),
        ("\"delta\"", "\"sigma\": 2, \"delta\"", "duplicate key in p.json:4:16: `sigma`; keep one"),
        (
            "[0.5,0.5,1]",
            "[0.5,NaN,1]",
            "`model[3][1]`: NaN is not a JSON number in p.json:2:47; give a number, in metres",
        ),
        ("[0.5,0.5,1]", "[0.5,-Infinity,1]", "`model[3][1]`: -Infinity is not a JSON number in p.json:2:47; give a"),
        ("0.04", "nan", "`delta`: nan is not a JSON number in p.json:4:25; give the distance tolerance"),
        ("[0.5,0.5,1]", "[0.5,1.,1]", "`model[3][1]`: invalid JSON number in p.json:2:47: 1.; give a number"),
        ("[0.5,0.5,1]", "[0.5,0.5,1,]", "`model[3]`: trailing comma in p.json:2:53: ]; remove it"),
        ("[0.5,0.5,1]", "[0.5,0.5 1]", "`model[3]`: expected `,` or `]` in p.json:2:51: 1; separate values by commas"),
        ("null}", "None}", "`putative`: invalid JSON value in p.json:6:13: None; give null, or a list of pairs"),
        ("\"putative\"", "putative", "key without double quotes in p.json:6:1: putative; put it in double quotes"),
        (
            "\"x\"",
            "\"C:\\x\"",
            "`id`: invalid JSON escape in p.json:1:45: x; write letters unescaped, and a backslash twice",
        ),
        (
            "\"x\"",
            "\"a\tb\"",
            "`id`: a line break, tab or other control character in a string in p.json:1:42: a; write it as `\\n`",
        ),
        ("null}", "null} x", "trailing characters after the problem in p.json:6:19: x; give one problem per file"),
        ("null}", "null", "unexpected end of file in p.json:6:13; the file may be truncated; write it again"),
        // The first of two faults, with invalid JSON behind it.
        ("[0.5,0.5,4],[-0.5,", "[0.5,\"q\",4],[NaN,", "`cloud[3][1]` is not a number in p.json:3:48: q; give a number"),
        (
            "{\"format\"",
            "7{\"format\"",
            "expected a problem in p.json:1:1: 7; give one `coherence-problem/1` as JSON, in braces",
        ),
    ] {
        let reported = fault(from, to);
        assert!(reported.starts_with(expected), "{expected}\n{reported}");
    }
    for (text, expected) in [
        (" \n", "empty file in p.json; give one `coherence-problem/1` as JSON, in braces"),
        ("{}", "`format` is missing in p.json:1:1; give \"coherence-problem/1\""),
        ("{\"model\": [[0,0,0],\n[1,0", "`model[1]`: unexpected end of file in p.json:2:4; the file may"),
    ] {
        let reported = parse(text).expect_err("an invalid problem").to_string();
        assert!(reported.starts_with(expected), "{expected}\n{reported}");
    }
}
