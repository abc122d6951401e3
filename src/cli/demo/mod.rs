//! `mapweld demo`: three simulated robots push growing maps of one building, and the service welds them.

mod local;
mod progress;
mod team;
mod verdict;

use std::path::PathBuf;
use std::pin::pin;

use super::files;
use super::push::random_seed;
use super::runtime::{block_on, interrupted, warnings_to_stderr};
use super::terminal::{say, tell};
use super::{Done, Failure, placements};
use crate::api::{self, MergeResult};
use crate::client::{Client, Patience, Recipient};
use crate::model::{SessionId, SessionSettings, Title, VersionSelector};
use local::LocalServer;
use progress::Progress;
use team::{PUSHES, Robot};
use verdict::Verdict;

/// Watch three simulated robots get their maps welded.
///
/// Simulates a building and three robots in it, each in a frame of its own, starts a server in this process, pushes the
/// growing maps with the same client as `mapweld push`, and compares the result with the truth. Serves until Ctrl-C.
#[derive(Debug, clap::Args)]
pub(super) struct Demo {
    /// Push to this server instead of one in this process.
    #[arg(long, value_name = "URL", conflicts_with_all = ["port", "data"])]
    server: Option<String>,
    /// Another seed, another building.
    #[arg(long, default_value_t = 7)]
    seed: u64,
    /// End when the result is there. The exit code is 0 when it is right, 3 when a robot was not placed, 1 when it is
    /// wrong.
    #[arg(long)]
    once: bool,
    /// Port of the server in this process; 0 takes a free one.
    #[arg(long, default_value_t = 0)]
    port: u16,
    /// Folder in which the server in this process keeps everything. Default: a temporary one, removed at the end.
    #[arg(long, value_name = "FOLDER")]
    data: Option<PathBuf>,
    /// Name of the session. Default: a new one.
    #[arg(long)]
    session: Option<SessionId>,
    /// Write the last overlay.png, map.png, map.yaml and result.json into this folder.
    #[arg(long, value_name = "FOLDER")]
    save: Option<PathBuf>,
}

impl Demo {
    pub(super) fn run(self) -> Result<Done, Failure> {
        warnings_to_stderr();
        say("simulating a building and three robots that explore it, each in a frame of its own")?;
        let robots = team::explore(self.seed)?;
        block_on(async {
            let mut stopped = pin!(interrupted());
            let local = tokio::select! {
                biased; // signals are heard before there is anything to clean up
                ended = &mut stopped => return ended.map(|()| Done::Entirely),
                local = self.local_server() => local?,
            };
            let url = local
                .as_ref()
                .map(LocalServer::url)
                .or(self.server.clone())
                .unwrap_or_default();
            let ended = tokio::select! {
                ended = self.play(&url, &robots) => ended,
                ended = &mut stopped => ended.map(|()| Done::Entirely),
            };
            if let Some(local) = local {
                local.stop().await?;
            }
            ended
        })?
    }

    async fn local_server(&self) -> Result<Option<LocalServer>, Failure> {
        match self.server {
            Some(_) => Ok(None),
            None => LocalServer::start(self.port, self.data.clone()).await.map(Some),
        }
    }

    /// Ends only with `--once`: else whoever asked for the demo looks at it until Ctrl-C.
    async fn play(&self, url: &str, robots: &[Robot]) -> Result<Done, Failure> {
        let client = Client::new(url, Patience::default(), self.seed)?;
        let session = self.session();
        let settings = SessionSettings {
            title: Some(Title::parse("Three simulated robots").expect("invariant: a short plain title")),
            ..SessionSettings::default()
        };
        client.put_session(&session, &settings).await?;
        say(&format!("pushing their maps to {url} as session {session}\n"))?;

        let version = push_all(&client, &session, robots).await?;
        let result = version.result.read().map_err(anyhow::Error::from)?;
        let verdict = Verdict::of(robots, &result);
        say(&format!("\n{}\n", verdict.table()))?;
        self.save(&client, &session, &version).await?;
        tell_where(&client, &session)?;

        let done = if placements::all_placed(&result) {
            Done::Entirely
        } else {
            Done::SomeNotPlaced
        };
        let complaints = verdict.complaints();
        for complaint in &complaints {
            tell(complaint)?;
        }
        if !self.once {
            say("\nserving until Ctrl-C")?;
            return std::future::pending().await;
        }
        if done == Done::Entirely && !complaints.is_empty() {
            return Err(anyhow::anyhow!("the result is wrong: {}", complaints.join("; ")).into());
        }
        Ok(done)
    }

    /// A server that stays may have seen an earlier demo; the same maps again would make no version.
    fn session(&self) -> SessionId {
        let fresh = || {
            let name = match (&self.server, &self.data) {
                (None, None) => "demo".to_owned(),
                _ => format!("demo-{:08x}", random_seed() & 0xffff_ffff),
            };
            SessionId::parse(&name).expect("invariant: made of small letters, digits and dashes")
        };
        self.session.clone().unwrap_or_else(fresh)
    }

    async fn save(&self, client: &Client, session: &SessionId, version: &api::Version) -> Result<(), Failure> {
        let Some(folder) = &self.save else {
            return Ok(());
        };
        files::make_folder(folder)?;
        let number = VersionSelector::Number(version.number);
        for name in ["overlay.png", "map.png", "map.yaml"] {
            files::write(folder, name, &client.fetch(session, number, name).await?)?;
        }
        files::write(folder, "result.json", version.result.as_str().as_bytes())?;
        say(&format!("written to {}\n", folder.display()))
    }
}

/// Each robot pushes its maps in turn, as if they drove at the same time; gives the version that has all of them.
async fn push_all(client: &Client, session: &SessionId, robots: &[Robot]) -> Result<api::Version, Failure> {
    let progress = Progress::new(robots, PUSHES);
    let mut newest = None;
    for push in 0..PUSHES {
        let mut job = None;
        for (index, robot) in robots.iter().enumerate() {
            let to = Recipient {
                session: session.clone(),
                robot: robot.name.clone(),
            };
            let pushed = client.push_map(&to, &robot.upload(push)).await?;
            progress.pushed(index, robot, push);
            job = pushed.job.or(job);
        }
        // The merge that the last of them caused takes the newest map of all.
        let version = match job {
            Some(job) => client.wait_for_version(job, |job| progress.merging(job)).await?,
            None => client.version(session, VersionSelector::Latest).await?,
        };
        let result = version.result.read().map_err(anyhow::Error::from)?;
        progress.say(&told(&version, &result))?;
        newest = Some(version);
    }
    progress.end();
    Ok(newest.expect("invariant: every robot pushes at least once"))
}

fn told(version: &api::Version, result: &MergeResult) -> String {
    let placed: Vec<&str> = placements::placed(result).map(|map| map.name.as_str()).collect();
    let fused = &result.fused;
    let cells = fused.counts.free + fused.counts.occupied;
    #[expect(clippy::cast_precision_loss, reason = "an area for people")]
    let area = cells as f64 * fused.resolution.powi(2);
    let seconds = result.timings.total_seconds;
    format!(
        "version {}: {} in one map of {area:.0} m2, merged in {seconds:.2} s",
        version.number,
        placed.join(", ")
    )
}

fn tell_where(client: &Client, session: &SessionId) -> Result<(), Failure> {
    let server = client.server();
    let version = format!("{server}v1/sessions/{session}/versions/latest");
    for (what, url) in [
        ("page", server.to_owned()),
        ("overlay", format!("{version}/overlay.png")),
        ("merged map", format!("{version}/map.png")),
        ("for Nav2", format!("{version}/map.yaml")),
        ("transforms", format!("{version}/transforms")),
        ("everything", version.clone()),
        ("API", format!("{server}docs")),
    ] {
        say(&format!("{what:>11}  {url}"))?;
    }
    Ok(())
}
