//! A private PostgreSQL for this run of the tests: Debian's programs, a cluster in a temporary folder, no port.

use std::io::{BufRead as _, BufReader, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

use super::skipped::skipped;

/// A database of its own in the cluster of this run.
#[derive(Debug, Clone)]
pub(crate) struct Database {
    socket: PathBuf,
    name: String,
}

impl Database {
    /// A new, empty database; nothing, and a word about it, when this machine has no PostgreSQL.
    pub(crate) fn fresh() -> Option<Self> {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        static CLUSTER: OnceLock<Option<Cluster>> = OnceLock::new();
        let cluster = CLUSTER.get_or_init(Cluster::start);
        let Some(cluster) = cluster else {
            skipped("every test of PostgreSQL", "postgresql");
            return None;
        };
        let name = format!("t{}", NEXT.fetch_add(1, Ordering::Relaxed));
        let database = Self {
            socket: cluster.folder.clone(),
            name: "postgres".to_owned(),
        };
        database.query(&format!("CREATE DATABASE {name}"));
        Some(Self { name, ..database })
    }

    /// How mapweld reaches it.
    pub(crate) fn url(&self) -> String {
        format!(
            "postgres://postgres@localhost/{}?host={}",
            self.name,
            self.socket.display()
        )
    }

    /// How mapweld reaches it by way of a port of this machine.
    pub(crate) fn url_by_port(&self, port: u16) -> String {
        format!("postgres://postgres@127.0.0.1:{port}/{}?sslmode=disable", self.name)
    }

    /// The socket that the database listens on.
    pub(crate) fn socket(&self) -> PathBuf {
        self.socket.join(".s.PGSQL.5432")
    }

    /// What the database answers to a statement: rows as lines.
    pub(crate) fn query(&self, statement: &str) -> String {
        let told = Command::new("psql")
            .args([
                "--no-psqlrc",
                "--quiet",
                "--tuples-only",
                "--no-align",
                "--username=postgres",
                "--host",
            ])
            .arg(&self.socket)
            .args(["--dbname", &self.name, "--set=ON_ERROR_STOP=1", "--command", statement])
            .output()
            .expect("psql runs");
        assert!(
            told.status.success(),
            "{statement}: {}",
            String::from_utf8_lossy(&told.stderr)
        );
        String::from_utf8(told.stdout).expect("text").trim().to_owned()
    }
}

impl Database {
    /// All tables with their rows, as statements.
    pub(crate) fn dump(&self) -> String {
        let told = Command::new("pg_dump")
            .args(["--no-owner", "--no-privileges", "--username=postgres", "--host"])
            .arg(&self.socket)
            .arg(&self.name)
            .output()
            .expect("pg_dump runs");
        assert!(told.status.success(), "{}", String::from_utf8_lossy(&told.stderr));
        let text = String::from_utf8(told.stdout).expect("text");
        // commands of psql itself, which older ones do not know
        text.lines()
            .filter(|line| !line.starts_with('\\') || *line == "\\.")
            .flat_map(|line| [line, "\n"])
            .collect()
    }

    /// Writes all of it into a file, as `pg_restore` reads it.
    pub(crate) fn back_up(&self, file: &Path) {
        let mut dump = Command::new("pg_dump");
        dump.args(["--format=custom", "--username=postgres", "--host"])
            .arg(&self.socket)
            .arg("--file")
            .arg(file)
            .arg(&self.name);
        succeeds(&mut dump);
    }

    /// Brings back what [`Self::back_up`] wrote, in place of what is there.
    pub(crate) fn restore(&self, file: &Path) {
        let mut restore = Command::new("pg_restore");
        restore
            .args([
                "--clean",
                "--if-exists",
                "--exit-on-error",
                "--username=postgres",
                "--host",
            ])
            .arg(&self.socket)
            .args(["--dbname", &self.name])
            .arg(file);
        succeeds(&mut restore);
    }

    /// Runs the statements of a file.
    pub(crate) fn load(&self, file: &Path) {
        let told = Command::new("psql")
            .args(["--no-psqlrc", "--quiet", "--username=postgres", "--host"])
            .arg(&self.socket)
            .args(["--dbname", &self.name, "--set=ON_ERROR_STOP=1", "--file"])
            .arg(file)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .output()
            .expect("psql runs");
        assert!(told.status.success(), "{}", String::from_utf8_lossy(&told.stderr));
    }
}

fn succeeds(command: &mut Command) {
    let told = command.output().expect("the program runs");
    assert!(
        told.status.success(),
        "{command:?}: {}",
        String::from_utf8_lossy(&told.stderr)
    );
}

/// The cluster. It ends, and its folder is removed, when the pipe to its keeper closes: that is when this process ends,
/// however it ends.
struct Cluster {
    folder: PathBuf,
    _keeper: Child,
}

/// Sorts as people do, unlike the records: an order that the database's own collation decides would be noticed.
const KEEPER: &str = r#"
set -e
folder=$(mktemp -d /tmp/mapweld-postgres.XXXXXX)
end() { "$1/pg_ctl" --pgdata="$folder/data" --mode=immediate stop >/dev/null 2>&1 || true; rm -rf "$folder"; }
trap 'end "$1"' EXIT
cd "$folder"
"$1/initdb" --pgdata="$folder/data" --username=postgres --auth=trust --no-sync --encoding=UTF8 \
  --locale=C.UTF-8 --locale-provider=icu --icu-locale=en >"$folder/log" 2>&1 || { cat "$folder/log"; exit 1; }
"$1/pg_ctl" --pgdata="$folder/data" --log="$folder/log" --wait --timeout=60 --options="-c listen_addresses='' \
  -c unix_socket_directories='$folder' -c fsync=off -c max_connections=300 -c shared_buffers=64MB" start >/dev/null \
  || { cat "$folder/log"; exit 1; }
chmod 711 "$folder"
echo "ready $folder"
cat >/dev/null || true
"#;

impl Cluster {
    fn start() -> Option<Self> {
        let programs = programs()?;
        let mut command = if is_root() {
            // PostgreSQL does not run as root
            let mut command = Command::new("runuser");
            command.args(["-u", "postgres", "--", "bash"]);
            command
        } else {
            Command::new("bash")
        };
        let mut keeper = command
            .args(["-c", KEEPER, "keeper"])
            .arg(&programs)
            .current_dir("/")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("bash runs");
        let mut told = BufReader::new(keeper.stdout.take().expect("it is piped"));
        let mut line = String::new();
        told.read_line(&mut line).expect("it can be read");
        let Some(folder) = line.trim().strip_prefix("ready ") else {
            told.read_to_string(&mut line).expect("it can be read");
            panic!("PostgreSQL does not start: {line}");
        };
        Some(Self {
            folder: PathBuf::from(folder),
            _keeper: keeper,
        })
    }
}

/// Where the newest server of this machine has its programs.
fn programs() -> Option<PathBuf> {
    let versions = std::fs::read_dir("/usr/lib/postgresql").ok()?;
    let newest = versions
        .filter_map(|entry| entry.ok()?.file_name().to_str()?.parse::<u32>().ok())
        .max()?;
    let programs = Path::new("/usr/lib/postgresql").join(newest.to_string()).join("bin");
    programs.join("initdb").exists().then_some(programs)
}

fn is_root() -> bool {
    let told = Command::new("id").arg("-u").output().expect("id runs");
    told.stdout.trim_ascii() == b"0"
}
