use super::CART;
use crate::model::GreyBox;
use crate::tests::assert_refused;

/// The error of the cart with one text in place of another.
fn refused(from: &str, to: &str) -> String {
    assert!(CART.contains(from), "{from}");
    GreyBox::from_toml(&CART.replacen(from, to, 1)).expect_err(to).to_string()
}

#[test]
fn every_error_says_where_it_is_and_what_to_do() {
    let cases = [
        // TOML itself.
        ("sample_time = 0.1", "sample_time = ", "line 1, column 15: this is not TOML: "),
        ("[states]", "[states", "line 3, column 8: this is not TOML: "),
        ("[inputs]", "[states]", "line 7, column 2: this is not TOML: duplicate key"),
        // Keys.
        ("[noise]", "[noises]", "line 21, column 2: the model has no key 'noises'; did you mean 'noise'?"),
        ("sample_time = 0.1", "sample_time = 0", "line 1, column 15: 'sample_time' is 0: it must be above 0"),
        (
            "sample_time = 0.1",
            "sample_time = 'x'",
            "line 1, column 15: 'sample_time' must be a number, but here is a text",
        ),
        (
            "sample_time = 0.1",
            "sample_time = inf",
            "line 1, column 15: 'sample_time' must be a finite number",
        ),
        ("sample_time = 0.1", "", "line 1, column 1: 'sample_time' is missing: the seconds of a sample"),
        ("start = 0, sd = 1", "start = 0", "line 4, column 1: 'states.position.sd' is missing"),
        (
            "start = 0, sd = 1",
            "start = 0, sd = -1",
            "line 4, column 30: 'states.position.sd' is -1: it must be 0 or more",
        ),
        ("start = 0, sd = 1", "start = 0, var = 1", "line 4, column 25: [states.position] has no key 'var'"),
        (
            "{ start = 0, sd = 1 }",
            "0",
            "line 4, column 12: 'states.position' must be a table, but here is a number",
        ),
        (
            "start = 0, sd = 1",
            "start = 'velocity', sd = 1",
            "line 4, column 22: a state begins before the first row is known: give a number, or an expression of \
             parameters",
        ),
        // Inputs between rows, and before.
        ("\"u\"", "{ channel = 'u', hold = 'first' }", "line 8, column 33: 'first' is none of: zero, linear"),
        (
            "\"u\"",
            "{ hold = 'zero' }",
            "line 8, column 1: 'inputs.force.channel' is missing: the channel of the log",
        ),
        (
            "\"u\"",
            "{ channel = 'u', hold = 'linear' }",
            "line 8, column 9: hold = \"linear\" goes with [derivative]: [next] knows an input at its rows alone",
        ),
        (
            "(force - ",
            "(force(2) - ",
            "line 16, column 35: an input some seconds ago is written force(t - delay); a product is written with '*'",
        ),
        (
            "(force - ",
            "(force(t - velocity) - ",
            "line 16, column 35: an input some seconds ago is written force(t - delay): the delay is a number or made of \
             parameters, not of states, inputs or the time",
        ),
        (
            "(force - ",
            "(force(t + 1) - ",
            "line 16, column 35: an input some seconds ago is written force(t - delay): what 'force' will be is not known",
        ),
        // Noises.
        ("velocity = 0.01", "velocity = 'speed'", "line 22, column 25: unknown name 'speed'"),
        (
            "y = 0.05",
            "y = { start = 0, unknown = true }",
            "line 23, column 31: 'measurement.y' starts at 0: it must be above 0",
        ),
        (
            "y = 0.05",
            "y = { start = 0.1, unknown = true, walk = 1 }",
            "line 23, column 52: [noise.measurement.y] has no key 'walk'",
        ),
        (
            "y = 0.05",
            "y = { start = 0.1, unknown = true, min = -1 }",
            "line 23, column 58: 'noise.measurement.y.min' is -1: it must be 0 or more",
        ),
        (
            "y = 0.05",
            "y = '0 * velocity'",
            "line 23, column 21: this standard deviation is 0: it must be above 0",
        ),
        // Parameters.
        (
            "start = 2, sd = 1",
            "start = 2, sd = 0",
            "line 11, column 26: 'parameters.mass.sd' is 0: it must be above 0",
        ),
        (
            "start = 2, sd = 1, unknown = true, min = 0.1",
            "start = 0, unknown = true",
            "line 11, column 1: the unknown parameter 'mass' starts at 0 and needs 'sd'",
        ),
        (
            "start = 2, sd = 1",
            "start = 0.05, sd = 1",
            "line 11, column 18: 'mass' starts at 0.05: it must be above 0.1",
        ),
        (
            "min = 0.1",
            "min = 0.1, max = 1.5",
            "line 11, column 18: 'mass' starts at 2: it must be between 0.1 and 1.5",
        ),
        ("min = 0.1", "max = 1.5", "line 11, column 18: 'mass' starts at 2: it must be below 1.5"),
        (
            "min = 0.1",
            "min = 3, max = 1",
            "line 11, column 60: 'max' is 1, but 'min' is 3: it must be above it",
        ),
        (
            "unknown = true",
            "unknown = 1",
            "line 11, column 39: 'parameters.mass.unknown' must be true or false",
        ),
        ("min = 0.1", "walk = -1", "line 11, column 52: 'parameters.mass.walk' is -1: it must be 0 or more"),
        // Names.
        ("damping = 0.4", "mass2.x = 1", "line 12, column 7: [parameters.mass2] has no key 'x'"),
        ("damping = 0.4", "velocity = 0.4", "line 12, column 1: the name 'velocity' is there twice"),
        ("damping = 0.4", "pi = 3", "line 12, column 1: 'pi' has a meaning in expressions"),
        ("damping = 0.4", "min = 3", "line 12, column 1: 'min' has a meaning in expressions"),
        ("damping = 0.4", "'a b' = 3", "line 12, column 1: 'a b' cannot stand in an expression"),
        ("damping = 0.4", "2b = 3", "line 12, column 1: '2b' cannot stand in an expression"),
        // Equations.
        (
            "position = \"position + dt * velocity\"\n",
            "",
            "line 4, column 1: the state 'position' has no equation: add it to [next]",
        ),
        (
            "[next]\n",
            "[next]\nspeed = '1'\n",
            "line 15, column 1: 'speed' is no state, so it has no equation",
        ),
        (
            "[next]\n",
            "[next]\npositoin = '1'\n",
            "line 15, column 1: 'positoin' is no state, so it has no equation; did you mean 'position'?",
        ),
        ("[next]", "[derivative]", "line 15, column 24: 'dt' stands only in [next]"),
        ("y = \"position\"", "y = \"position * dt\"", "line 19, column 17: 'dt' stands only in [next]"),
        (
            "y = \"position\"",
            "y = true",
            "line 19, column 5: 'outputs.y' must be a number, but here is true or false",
        ),
        ("y = \"position\"", "y = \"\"", "line 19, column 5: 'outputs.y' is empty"),
        (
            "y = \"position\"",
            "y = \"1/(2 - 2)\"",
            "line 19, column 5: this expression is not a finite number",
        ),
        ("y = \"position\"", "u = \"position\"", "line 8, column 9: the channel 'u' is an output too"),
        ("y = \"position\"\n", "", "line 18, column 2: [outputs] is empty"),
        (
            "+ dt * velocity",
            "+ dt * velocty",
            "line 15, column 29: unknown name 'velocty'; did you mean 'velocity'?",
        ),
        (
            "(force - damping * velocity)",
            "(force - damping * velocity",
            "line 16, column 29: this '(' is not closed",
        ),
        ("/ mass", "/ mass)", "line 16, column 64: this ')' closes nothing"),
        (
            "\"position + dt * velocity\"",
            "'''\nposition\n + dt * volocity'''",
            "line 17, column 9: unknown name 'volocity'",
        ),
        (
            "\"position + dt * velocity\"",
            "\"position + \\u0064t * volocity\"",
            "line 15, column 12: unknown name 'volocity'",
        ),
        ("[next]", "[next]\n[derivative]", "line 15, column 2: there are both [next] and [derivative]"),
        ("sample_time", "substeps = 2\nsample_time", "line 1, column 1: 'substeps' goes with [derivative]"),
        // Noise.
        ("measurement = { y = 0.05 }", "", "line 21, column 2: 'noise.measurement' is missing"),
        (
            "measurement = { y = 0.05 }",
            "measurement = {}",
            "line 23, column 1: 'noise.measurement.y' is missing",
        ),
        ("{ y = 0.05 }", "{ y = 0 }", "line 23, column 21: 'noise.measurement.y' is 0: it must be above 0"),
        ("{ y = 0.05 }", "{ y = 0.05, z = 1 }", "line 23, column 27: 'z' is no output of the model"),
        (
            "{ velocity = 0.01 }",
            "{ velocitty = 0.01 }",
            "line 22, column 13: 'velocitty' is no state of the model; did you mean 'velocity'?",
        ),
    ];
    let wrong: Vec<String> = cases
        .into_iter()
        .map(|(from, to, expected)| (to, expected, refused(from, to)))
        .filter(|(_, expected, found)| !found.starts_with(expected))
        .map(|(to, expected, found)| format!("{to}:\n  found    {found}\n  expected {expected}"))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn substeps_are_a_whole_number() {
    let text = "substeps = COUNT\nsample_time = 1\n[states]\nx = { sd = 1 }\n[derivative]\nx = '-x'\n\
                [outputs]\ny = 'x'\n[noise]\nmeasurement.y = 1";
    assert!(GreyBox::from_toml(&text.replace("COUNT", "4")).is_ok());
    for count in ["0", "1.5", "-1", "1001"] {
        let error = GreyBox::from_toml(&text.replace("COUNT", count)).unwrap_err().to_string();
        assert!(
            error.starts_with("line 1, column 12: 'substeps' must be a whole number from 1 to 1000"),
            "{error}"
        );
    }
    assert_refused(GreyBox::from_toml(""), "'sample_time' is missing");
}

#[test]
fn no_text_is_a_panic() {
    let pieces: Vec<&str> =
        "( ) + - * / ^ , . = [ ] { } ' \" \\ # \n 0 1e9 x dt t pi sin( max( µ … 'x' = [[ ]] inf nan true if then else within and or not < >= ; : table( 'if x > 0 then lines(x; 0:1 , 1:2) else dead( sat("
            .split(' ')
            .collect();
    let mut random = oorandom::Rand32::new(7);
    let mut read = 0;
    for _ in 0..3000 {
        let mut text: Vec<char> = CART.chars().collect();
        for _ in 0..1 + random.rand_range(0..3) {
            let at = random.rand_range(0..text.len() as u32) as usize;
            let cut = (at + random.rand_range(0..4) as usize).min(text.len());
            let piece = pieces[random.rand_range(0..pieces.len() as u32) as usize];
            text.splice(at..cut, piece.chars());
        }
        let text: String = text.into_iter().collect();
        match GreyBox::from_toml(&text) {
            Ok(_) => read += 1,
            Err(error) => assert!(error.to_string().starts_with("line "), "{error}"),
        }
    }
    // Most are refused, and some edits do no harm.
    assert!((10..1500).contains(&read), "{read}");
}

/// Before anything that grows with the square of their number is computed.
#[test]
fn equations_have_a_size() {
    let list = |count: usize, line: &dyn Fn(usize) -> String| (0..count).map(line).collect::<String>();
    let text = |states: usize, unknowns: usize, inputs: usize, outputs: usize| {
        format!(
            "sample_time = 1\n[inputs]\n{}[parameters]\n{}[states]\n{}[next]\n{}[outputs]\n{}[noise]\nmeasurement = {{ {} }}\n",
            list(inputs, &|index| format!("u{index} = 'u{index}'\n")),
            list(unknowns, &|index| format!("p{index} = {{ start = 0, sd = 1, unknown = true }}\n")),
            list(states, &|index| format!("x{index} = {{ start = 0, sd = 1 }}\n")),
            list(states, &|index| format!("x{index} = '0.9 * x{index}'\n")),
            list(outputs, &|index| format!("y{index} = 'x0'\n")),
            (0..outputs).map(|index| format!("y{index} = 1")).collect::<Vec<_>>().join(", "),
        )
    };
    assert!(GreyBox::from_toml(&text(2, 3, 2, 2)).is_ok());
    let together = "states and unknown parameters together, and equations have up to 200";
    for (text, expected) in [
        (text(10_000, 0, 0, 1), format!("there are 10000 {together}")),
        (text(1, 10_000, 0, 1), format!("there are 10001 {together}")),
        (text(101, 100, 0, 1), format!("there are 201 {together}")),
        (text(1, 0, 201, 1), "there are 201 inputs, and".to_owned()),
        (text(1, 0, 0, 201), "there are 201 outputs, and".to_owned()),
    ] {
        let error = GreyBox::from_toml(&text).unwrap_err().to_string();
        assert!(error.starts_with("line ") && error.contains(&expected), "{error}");
    }
}
