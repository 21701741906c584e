use super::*;

fn names(folder: &Path) -> Vec<String> {
    let name = |entry: io::Result<fs::DirEntry>| entry.unwrap().file_name().into_string().unwrap();
    let mut names: Vec<String> = fs::read_dir(folder).unwrap().map(name).collect();
    names.sort();
    names
}

#[test]
fn only_what_nobody_holds_is_swept() {
    let folder = tempfile::tempdir().unwrap();
    let ours = |letters: &str| folder.path().join(format!("{BEFORE}{letters}{AFTER}"));
    for letters in ["abcdefABCD12", "abcdefABCD1", "abcdefABCD123", "abcdefABCD1_"] {
        fs::write(ours(letters), "left").unwrap();
    }
    fs::write(folder.path().join(".thetahat-config"), "mine").unwrap();
    fs::create_dir(ours("a0a0a0a0a0a0")).unwrap();
    let live = passing(folder.path(), true).unwrap();
    sweep(folder.path());
    assert!(live.path().exists() && is_passing(live.path().file_name().unwrap()));
    drop(live);
    let mut left = [
        ".thetahat-a0a0a0a0a0a0.tmp",
        ".thetahat-abcdefABCD1.tmp",
        ".thetahat-abcdefABCD123.tmp",
        ".thetahat-abcdefABCD1_.tmp",
        ".thetahat-config",
    ];
    left.sort_unstable();
    assert_eq!(names(folder.path()), left);
}

#[test]
fn two_that_sweep_and_write_at_once_do_each_other_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    std::thread::scope(|scope| {
        for writer in 0..4 {
            let path = folder.path().join(format!("{writer}.txt"));
            scope.spawn(move || {
                for round in 0..50 {
                    sweep(super::folder(&path));
                    let file = filled(&path, None, |file| write!(file, "{round}")).unwrap();
                    file.persist(&path).unwrap();
                }
            });
        }
    });
    assert_eq!(names(folder.path()), ["0.txt", "1.txt", "2.txt", "3.txt"]);
    assert!((0..4).all(|writer| fs::read(folder.path().join(format!("{writer}.txt"))).unwrap() == b"49"));
}

#[test]
fn one_run_at_a_time_holds_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state");
    let mut first = Held::open(&path).unwrap();
    let mut second = Held::open(&path).unwrap();
    // Neither has anything to hold yet: the first to write has it.
    first.write(b"1").unwrap();
    assert!(second.write(b"2").unwrap_err().message().contains("another run is writing it"));
    assert!(Held::open(&path).is_err());
    // It keeps it over a replacement.
    first.write(b"11").unwrap();
    assert!(Held::open(&path).is_err());
    drop(first);
    assert_eq!(Held::open(&path).unwrap().read().unwrap().unwrap(), b"11");
    assert_eq!(names(folder.path()), ["state"]);
}

#[cfg(unix)]
#[test]
fn what_is_not_yet_whole_is_its_owners_alone() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report");
    fs::write(&path, "old").unwrap();
    for mode in [0o644, 0o640, 0o600, 0o666] {
        fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
        replace(&path, |_| {
            let passing = names(folder.path()).into_iter().find(|name| is_passing(name.as_ref())).unwrap();
            let now = fs::metadata(folder.path().join(passing)).unwrap().permissions().mode();
            assert_eq!(now & 0o777, 0o600);
            Ok(())
        })
        .unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, mode);
    }
}
