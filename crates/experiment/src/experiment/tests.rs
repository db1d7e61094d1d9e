use super::*;

fn plan(text: &str) -> Result<Plan, String> {
    let experiment: Experiment =
        toml::from_str(text).map_err(|error| Fault::in_toml(Path::new("e.toml"), text, &error).to_string())?;
    Plan::resolve(experiment, "e", Path::new(""), Path::new("e.toml"), &Texts::of(Path::new("e.toml"), text), &[])
        .map_err(|faults| faults.iter().map(|fault| fault.to_string() + "\n").collect())
}

#[test]
fn a_grid_of_trials_is_resolved() {
    let plan = plan(
        "question = 'why'\nsource = 'virtual-points'\n[[vary]]\nkey = 'source.distance'\nvalues = [2.0, 3.0]\n\
             [[vary]]\nkey = 'pipeline.solver'\nvalues = ['triad', 'kabsch']\n",
    )
    .unwrap();
    let names: Vec<&str> = plan.trials.iter().map(|trial| trial.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "001-distance-2.0-solver-triad",
            "002-distance-2.0-solver-kabsch",
            "003-distance-3.0-solver-triad",
            "004-distance-3.0-solver-kabsch"
        ]
    );
    assert_eq!(plan.trials[1].resolved.pipeline.solver.name, "kabsch");
    assert!(plan.trials[1].resolved.vary.is_empty());
}

#[test]
fn settings_that_vary_together_are_cases_of_one_axis() {
    let text = "question = 'why'\nsource = 'virtual-layouts'\n[[vary]]\nkey = 'camera'\ncases = [\n\
                    { label = 'near', set = { 'source.distance' = 2.0, 'source.rig.focal' = 500.0 } },\n\
                    { label = 'far', set = { 'source.distance' = 5.0, 'source.rig.focal' = 800.0 } },\n]\n";
    let plan_of = plan(text).unwrap();
    let names: Vec<&str> = plan_of.trials.iter().map(|trial| trial.name.as_str()).collect();
    assert_eq!(names, ["001-camera-near", "002-camera-far"]);
    let settings = &plan_of.trials[1].resolved.source.settings;
    assert_eq!((settings["distance"].as_float(), settings["rig"]["focal"].as_float()), (Some(5.0), Some(800.0)));
    assert!(plan(&text.replace("'far'", "'near'")).unwrap_err().contains("two cases with the same name"));
    assert!(plan(&text.replace("key = 'camera'", "key = 'camera'\nvalues = [1]")).unwrap_err().contains("and cases"));
    assert!(plan(&text.replace("source.rig.focal", "source.rig.fokal")).unwrap_err().contains("e.toml:6:52"));
}

#[test]
fn a_resolved_trial_is_an_experiment_of_its_own() {
    let first = plan("question = 'why'\nsource = 'virtual-points'\n").unwrap();
    let text = toml::to_string(&first.trials[0].resolved).unwrap();
    let again = plan(&text).unwrap();
    assert_eq!(again.trials[0].resolved, first.trials[0].resolved);
}

#[test]
fn the_command_line_has_the_last_word() {
    let experiment: Experiment = toml::from_str("question = 'why'\nsource = 'virtual-points'").unwrap();
    let settings = ["source.frames=2".to_owned(), "pipeline.solver=triad".to_owned()];
    let changed = changed(experiment.clone(), &settings).unwrap();
    assert_eq!(changed.source.settings["frames"].as_integer(), Some(2));
    assert_eq!(changed.pipeline.solver.name, "triad");
    assert!(super::changed(experiment, &["source".to_owned()]).is_err());
}

#[test]
fn a_setting_of_the_pipeline_needs_no_prefix_and_may_have_it() {
    let experiment: Experiment = toml::from_str("question = 'why'\nsource = 'virtual-points'").unwrap();
    let settings = ["detector.features=2000", "acceptance.max-p-wrong=5e-3"];
    let with = |prefix: &str| settings.map(|setting| format!("{prefix}{setting}"));
    let full = super::changed(experiment.clone(), &with("pipeline.")).unwrap();
    assert_eq!(super::changed(experiment, &with("")).unwrap(), full);
    let pipeline = PipelineSettings::default();
    for prefix in ["", "pipeline."] {
        let changed = sweep::changed_pipeline(&pipeline, &with(prefix)).unwrap();
        assert_eq!((&changed.detector, &changed.acceptance), (&full.pipeline.detector, &full.pipeline.acceptance));
    }
}

#[test]
fn faults_name_their_line() {
    let message = |text: &str| plan(text).unwrap_err();
    assert_eq!(
        message("question = 'why'\nsource = 'virtual-points'\n\n[pipeline]\nsolver = 'kabsh'\n").trim(),
        format!(
            "no solver is called `kabsh`, did you mean `kabsch`? There are {} in e.toml:5:10",
            seafix_referencing::SOLVERS.names().collect::<Vec<_>>().join(", ")
        )
    );
    assert!(
        message("question = 'why'\nsorce = 'virtual-points'\n")
            .starts_with("unknown key in e.toml:2:1: `sorce`; did you mean `source`?")
    );
    assert!(
        message("question = 'why'\nsource = 'virtual-points'\n[[vary]]\nkey = 'pipeline.solvr'\nvalues = ['triad']\n")
            .contains("e.toml:4:7")
    );
    assert!(message("question = ''\nsource = 'virtual-points'\n").contains("no question in e.toml:1"));
    let published = |source: &str, quantity: &str, range: &str| {
        message(&format!(
            "question = 'why'\nsource = 'virtual-points'\n[[published]]\nsource = '{source}'\nquantity = '{quantity}'\nrange = {range}\n"
        ))
    };
    assert!(published("", "fit_rms", "[0.0, 0.1]").starts_with("no source in e.toml:4"));
    assert!(published("a book", "nees", "[0.0, 0.1]").starts_with("unknown quantity in e.toml:5"));
    assert!(published("a book", "fit_rms", "[0.2, 0.1]").starts_with("no range in e.toml:6"));
    assert!(
        message("question = 'why'\nsource = { name = 'virtual-points', distanc = 2 }\n")
            .contains("did you mean `distance`")
    );
}
