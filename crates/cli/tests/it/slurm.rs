//! A sweep by Slurm, with a real controller and node on this machine. It needs Debian's `slurm-wlm`, which includes
//! `munge`, and root to start their daemons.

use std::{
    fs,
    net::TcpListener,
    os::unix::fs::PermissionsExt,
    path::Path,
    process::{Child, Command, Stdio},
    thread::sleep,
    time::Duration,
};

const EXPERIMENT: &str = "question = 'Is it the run?'\nseed = 3\nsource = { name = 'virtual-points', frames = 200 }\n\
    [[vary]]\nkey = 'pipeline.solver'\nvalues = ['kabsch', 'triad']\n";

/// A cluster of one node, with its daemons in a separate folder.
struct Cluster<'a> {
    folder: &'a Path,
    daemons: Vec<Child>,
}

impl<'a> Cluster<'a> {
    fn start(folder: &'a Path) -> Self {
        let here = |program: &str| ["/usr/sbin", "/usr/bin"].iter().any(|bin| Path::new(bin).join(program).exists());
        let root = Command::new("id").arg("-u").output().unwrap().stdout == b"0\n";
        let missing = ["munged", "slurmctld", "slurmd", "sbatch", "sinfo"].into_iter().find(|program| !here(program));
        assert!(root && missing.is_none(), "it takes root and Slurm: apt-get install slurm-wlm; missing: {missing:?}");
        fs::set_permissions(folder, fs::Permissions::from_mode(0o755)).unwrap();
        let at = folder.display();
        let host = fs::read_to_string("/proc/sys/kernel/hostname").unwrap();
        let host = host.trim().split('.').next().unwrap();
        // Free ports.
        let [one, other] = [0, 0].map(|_| TcpListener::bind("127.0.0.1:0").unwrap());
        let [controller, node] = [&one, &other].map(|port| port.local_addr().unwrap().port());
        drop((one, other));
        for name in ["state", "spool"] {
            fs::create_dir(folder.join(name)).unwrap();
        }
        let key: Vec<u8> = (0..128).map(|k| (std::process::id() as u8).wrapping_mul(k).wrapping_add(k)).collect();
        fs::write(folder.join("munge.key"), key).unwrap();
        fs::set_permissions(folder.join("munge.key"), fs::Permissions::from_mode(0o600)).unwrap();
        let configuration = format!(
            "ClusterName=test\nSlurmctldHost={host}(127.0.0.1)\nSlurmUser=root\nSlurmdUser=root\nAuthType=auth/munge\n\
             AuthInfo=socket={at}/munge.sock\nCredType=cred/munge\nSlurmctldPort={controller}\nSlurmdPort={node}\n\
             StateSaveLocation={at}/state\nSlurmdSpoolDir={at}/spool\nSlurmctldPidFile={at}/slurmctld.pid\n\
             SlurmdPidFile={at}/slurmd.pid\nSlurmctldLogFile={at}/slurmctld.log\nSlurmdLogFile={at}/slurmd.log\n\
             ProctrackType=proctrack/pgid\nTaskPlugin=task/none\nSelectType=select/cons_tres\nSelectTypeParameters=CR_Core\n\
             JobAcctGatherType=jobacct_gather/none\nAccountingStorageType=accounting_storage/none\nMpiDefault=none\n\
             ReturnToService=2\nNodeName={host} NodeAddr=127.0.0.1 CPUs=1 State=UNKNOWN\n\
             PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP\n"
        );
        fs::write(folder.join("slurm.conf"), configuration).unwrap();
        let mut cluster = Self { folder, daemons: Vec::new() };
        let munge: Vec<String> = [
            ("key-file", "munge.key"),
            ("socket", "munge.sock"),
            ("pid-file", "munged.pid"),
            ("log-file", "munged.log"),
            ("seed-file", "munge.seed"),
        ]
        .iter()
        .map(|(option, file)| format!("--{option}={at}/{file}"))
        .collect();
        let munge: Vec<&str> =
            ["--foreground", "--force"].into_iter().chain(munge.iter().map(String::as_str)).collect();
        cluster.daemon("/usr/sbin/munged", &munge);
        cluster.until("munged listened", |cluster| cluster.folder.join("munge.sock").exists());
        cluster.daemon("/usr/sbin/slurmctld", &["-D"]);
        cluster.daemon("/usr/sbin/slurmd", &["-D", "-N", host]);
        cluster.until("the node was idle", |cluster| {
            let state = cluster.command("sinfo").args(["-h", "-o", "%T"]).output().unwrap();
            state.stdout == b"idle\n"
        });
        cluster
    }

    fn command(&self, program: &str) -> Command {
        let mut command = Command::new(program);
        command.env("SLURM_CONF", self.folder.join("slurm.conf")).current_dir(self.folder);
        command
    }

    fn daemon(&mut self, program: &str, arguments: &[&str]) {
        let child = self
            .command(program)
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        self.daemons.push(child.unwrap());
    }

    fn until(&mut self, what: &str, holds: impl Fn(&Self) -> bool) {
        while !holds(self) {
            let ended = self.daemons.iter_mut().find_map(|daemon| daemon.try_wait().unwrap());
            assert!(ended.is_none(), "a daemon ended with {ended:?} before {what}");
            sleep(Duration::from_millis(100));
        }
    }
}

impl Drop for Cluster<'_> {
    fn drop(&mut self) {
        for daemon in self.daemons.iter_mut().rev() {
            let _ = daemon.kill();
            let _ = daemon.wait();
        }
    }
}

/// Three shards of a job array merge into the bytes of one run, and a failed task is reported. Seen to fail with the
/// array numbered from 0.
#[test]
#[ignore = "long: needs Slurm"]
fn a_sweep_by_slurm_is_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let cluster = Cluster::start(folder);
    fs::write(folder.join("e.toml"), EXPERIMENT).unwrap();
    let seafix = |arguments: &[&str]| {
        let out = cluster.command(env!("CARGO_BIN_EXE_seafix")).args(arguments).output().unwrap();
        (out.status.code(), String::from_utf8(out.stderr).unwrap())
    };
    assert_eq!(seafix(&["run", "e.toml", "--untimed", "--out", "whole"]).0, Some(0));
    let sweep = ["sweep", "e.toml", "--untimed", "--shards", "3", "--executor", "slurm", "--out", "swept"];
    let (code, error) = seafix(&sweep);
    assert_eq!(code, Some(0), "{error}");
    for file in ["001-solver-kabsch.mcap", "002-solver-triad.mcap", "results.csv", "results.parquet"] {
        assert!(
            fs::read(folder.join("whole").join(file)).unwrap() == fs::read(folder.join("swept").join(file)).unwrap(),
            "{file}"
        );
    }
    // A task that cannot write fails, and the sweep names it; the same command resumes it.
    fs::create_dir_all(folder.join("again-shards")).unwrap();
    fs::write(folder.join("again-shards/2"), "in the way").unwrap();
    let again = ["sweep", "e.toml", "--untimed", "--shards", "3", "--executor", "slurm", "--out", "again"];
    let (code, error) = seafix(&again);
    assert!(code == Some(4) && error.contains("shards 2 did not end"), "{error}");
    fs::remove_file(folder.join("again-shards/2")).unwrap();
    assert_eq!(seafix(&again).0, Some(0));
    assert!(fs::read(folder.join("whole/results.csv")).unwrap() == fs::read(folder.join("again/results.csv")).unwrap());
    println!("3 shards by Slurm: the bytes of one run; a failed task reported and repeated");
}
