//! The layout of the page in a browser. Skipped without Chromium.

use std::{fs, process::Command};

use seafix_report::{Forms, report};

use crate::made_up::write_run;

/// A page that shows the report at both widths and lists faulty elements.
///
/// Faulty elements overflow or are too small to read; a wide table may scroll in its own box.
const FRAME: &str = "<iframe id=f style='height:900px;border:0' src=report.html></iframe><p id=found></p><script>
onload = () => { const said = [];
for (const width of [380, 1280]) { f.style.width = width + 'px';
  const page = f.contentDocument, sheet = page.documentElement;
  if (sheet.scrollWidth > sheet.clientWidth) said.push(`${width}: ${sheet.scrollWidth} of ${sheet.clientWidth} px`);
  for (const one of page.querySelectorAll('svg, table, p, pre, img')) {
    if (one.closest('.scroll')) continue;
    const { right, width: shown } = one.getBoundingClientRect();
    if (shown > 0 && right > sheet.clientWidth + 1) said.push(`${width}: ${one.tagName} to ${right}`); }
  for (const word of page.querySelectorAll('svg text')) {
    const { width: w, height: h } = word.getBoundingClientRect();
    if (w > 0 && Math.min(w, h) < 7 && word.textContent.length > 1) said.push(`${width}: ${word.textContent} ${w} by ${h} px`); } }
found.textContent = 'amiss: ' + said.join('; ') + '.'; }
</script>";

#[test]
fn nothing_sticks_out_of_a_wide_page_or_a_narrow_one_and_words_can_be_read() {
    let folder = tempfile::tempdir().unwrap();
    write_run(folder.path(), &[2.0, 3.0, 5.0]);
    let page = report(folder.path(), &folder.path().join("report"), Forms::ALL).unwrap().page;
    let frame = page.with_file_name("frame.html");
    fs::write(&frame, FRAME).unwrap();
    let mut browser = Command::new("chromium");
    browser.args(["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--enable-logging=stderr"]);
    browser.args(["--disable-background-networking", "--disable-component-update", "--disable-sync", "--dump-dom"]);
    browser
        .arg("--allow-file-access-from-files")
        .arg(format!("--user-data-dir={}", folder.path().join("own").display()));
    let Ok(ran) = browser.arg(format!("file://{}", frame.display())).output() else { return };
    let shown = String::from_utf8_lossy(&ran.stdout);
    assert!(shown.contains("amiss: ."), "{}", shown.split("<p id=").last().unwrap_or_default());
    let console = String::from_utf8_lossy(&ran.stderr).lines().filter(|line| line.contains("CONSOLE")).count();
    assert_eq!(console, 0, "the page writes to the console");
}
