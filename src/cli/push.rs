//! `mapweld push`: sends a robot's map to a server, once or whenever it changes.

use std::hash::{BuildHasher, Hasher, RandomState};
use std::path::PathBuf;
use std::time::Duration;

use serde_json::json;
use tokio::time::{Instant, sleep_until};

use super::files::{MapFiles, file_name};
use super::runtime::{block_on, interrupted, warnings_to_stderr};
use super::terminal::{say, tell};
use super::watch::{Look, Watch};
use super::{BadInput, Done, Failure, placements};
use crate::api;
use crate::client::{Backoff, Client, ClientError, FilePart, Patience, Recipient, Spool, Upload};
use crate::codec::Limits;
use crate::model::{RobotId, SessionId};

/// How often `--watch` looks at the files. A map counts as complete when it has not changed from one look to the next.
const LOOK_EVERY: Duration = Duration::from_millis(500);

/// Push a map to a server, once or whenever it changes.
#[derive(Debug, clap::Args)]
pub(super) struct Push {
    /// The map: a ROS map YAML file beside its PNG or PGM.
    map: PathBuf,
    /// Address of the server.
    #[arg(long, env = "MAPWELD_SERVER", default_value = "http://127.0.0.1:8080")]
    server: String,
    /// The key that the server asks for.
    #[arg(long, env = "MAPWELD_KEY", hide_env_values = true)]
    key: Option<String>,
    /// Trust servers whose certificates these vouch for (PEM), instead of those that the system trusts.
    #[arg(long, env = "MAPWELD_CA", value_name = "FILE")]
    ca: Option<PathBuf>,
    /// The session: which robots map together. Made by the first push.
    #[arg(long)]
    session: SessionId,
    /// The robot whose map this is.
    #[arg(long)]
    robot: RobotId,
    /// Wait for the version that has the map in it, and print where the robot is placed. Exit code 3 when it is not.
    #[arg(long)]
    wait: bool,
    /// Stay, and push the map whenever it changes.
    #[arg(long)]
    watch: bool,
    /// Keep a map that could not be sent in this folder (the newest of each robot), and send what waits there first.
    #[arg(long, value_name = "FOLDER")]
    spool: Option<PathBuf>,
    /// Give up after this many seconds; `--watch` never does.
    #[arg(long, value_name = "SECONDS", default_value_t = 120)]
    retry_for: u64,
    /// Print JSON, one line a push: the map, and with --wait the version.
    #[arg(long)]
    json: bool,
}

impl Push {
    pub(super) fn run(self) -> Result<Done, Failure> {
        let limits = Limits::default();
        let patience = Patience {
            give_up_after: Duration::from_secs(self.retry_for),
            ..Patience::default()
        };
        let authority = match self.ca.clone() {
            Some(file) => Some(std::fs::read(&file).bad_input(move || format!("cannot read {}", file.display()))?),
            None => None,
        };
        let mut client = Client::trusting(&self.server, patience, random_seed(), authority.as_deref())?;
        if let Some(key) = &self.key {
            client = client.with_key(key)?;
        }
        let spool = self
            .spool
            .as_ref()
            .map(Spool::open)
            .transpose()
            .map_err(ClientError::from)?;
        let sender = Sender {
            to: Recipient {
                session: self.session,
                robot: self.robot,
            },
            client,
            spool,
            wait: self.wait,
            json: self.json,
        };
        warnings_to_stderr();
        block_on(async {
            if self.watch {
                let watched = Watch::new(&self.map, limits);
                tokio::select! {
                    ended = sender.watch(watched) => ended,
                    stopped = interrupted() => stopped.map(|()| Done::Entirely),
                }
            } else {
                let files = MapFiles::read(&self.map, &limits)?;
                sender.send_once(&upload(files)).await
            }
        })?
    }
}

struct Sender {
    to: Recipient,
    client: Client,
    spool: Option<Spool>,
    wait: bool,
    json: bool,
}

impl Sender {
    async fn send_once(&self, upload: &Upload) -> Result<Done, Failure> {
        if let Some(spool) = &self.spool {
            spool.keep(&self.to, upload).map_err(ClientError::from)?;
            self.send_spooled(spool).await?;
        }
        let pushed = match self.client.push_map(&self.to, upload).await {
            Ok(pushed) => pushed,
            Err(error) => return Err(self.undelivered(error, upload)?),
        };
        self.delivered(upload)?;
        self.tell_result(pushed).await
    }

    /// What other pushes have left behind; a map that is refused for good is dropped, for it will never be taken.
    async fn send_spooled(&self, spool: &Spool) -> Result<(), Failure> {
        for to in spool.waiting().map_err(ClientError::from)? {
            if to == self.to {
                continue;
            }
            let Some(upload) = spool.get(&to).map_err(ClientError::from)? else {
                continue;
            };
            match self.client.push_map(&to, &upload).await {
                Ok(pushed) => tell(&format!(
                    "sent what waited: map {} of {}/{}",
                    pushed.map.id, to.session, to.robot
                ))?,
                Err(error) if error.is_transient() => return Err(error.into()),
                Err(error) => tell(&format!("dropped what waited for {}/{}: {error}", to.session, to.robot))?,
            }
            spool.forget(&to, &upload).map_err(ClientError::from)?;
        }
        Ok(())
    }

    fn delivered(&self, upload: &Upload) -> Result<(), Failure> {
        match &self.spool {
            Some(spool) => Ok(spool.forget(&self.to, upload).map_err(ClientError::from)?),
            None => Ok(()),
        }
    }

    /// Says where the map is now, when it is not at the server.
    fn undelivered(&self, error: ClientError, upload: &Upload) -> Result<Failure, Failure> {
        if !error.is_transient() {
            self.delivered(upload)?;
        } else if self.spool.is_some() {
            tell("the map is kept in the spool folder; the next push sends it")?;
        }
        Ok(error.into())
    }

    async fn watch(&self, mut watch: Watch) -> Result<Done, Failure> {
        let endless = Patience {
            give_up_after: Duration::MAX,
            ..Patience::default()
        };
        let mut waiting: Option<(Upload, Backoff, Instant)> = None;
        if let Some(spool) = &self.spool
            && let Some(upload) = spool.get(&self.to).map_err(ClientError::from)?
        {
            waiting = Some((upload, Backoff::new(endless, random_seed()), now()));
        }
        let mut next_look = now();
        loop {
            if now() >= next_look {
                next_look = now() + LOOK_EVERY;
                match watch.look() {
                    Look::Nothing => {}
                    Look::Broken(failure) => tell(&format!("not pushed: {failure}"))?,
                    Look::New(files) => {
                        let upload = upload(files);
                        if let Some(spool) = &self.spool {
                            spool.keep(&self.to, &upload).map_err(ClientError::from)?;
                        }
                        waiting = Some((upload, Backoff::new(endless, random_seed()), now()));
                    }
                }
            }
            if let Some((upload, mut backoff, due)) = waiting.take() {
                if now() < due {
                    waiting = Some((upload, backoff, due));
                } else if let Err(error) = self.send_watched(&upload).await? {
                    let wait = backoff.next_wait(error.retry_after()).unwrap_or(LOOK_EVERY);
                    tell(&format!("{error}; trying again in {:.1} s", wait.as_secs_f64()))?;
                    waiting = Some((upload, backoff, now() + wait));
                }
            }
            let wake = waiting.as_ref().map_or(next_look, |(_, _, due)| next_look.min(*due));
            sleep_until(wake).await;
        }
    }

    /// One attempt; the inner error is one that another attempt may mend.
    async fn send_watched(&self, upload: &Upload) -> Result<Result<(), ClientError>, Failure> {
        match self.client.push_map_once(&self.to, upload).await {
            Ok(pushed) => {
                self.delivered(upload)?;
                match self.tell_result(pushed).await {
                    Ok(_) => {}
                    Err(Failure::NobodyListens) => return Err(Failure::NobodyListens),
                    Err(failure) => tell(&failure.to_string())?,
                }
                Ok(Ok(()))
            }
            Err(error) if error.is_transient() => Ok(Err(error)),
            Err(error) => {
                self.delivered(upload)?;
                tell(&format!("not pushed: {error}"))?;
                Ok(Ok(()))
            }
        }
    }

    /// Prints what became of a map that the server has.
    async fn tell_result(&self, pushed: api::Pushed) -> Result<Done, Failure> {
        let version = match (self.wait, pushed.job) {
            (true, Some(job)) => Some(self.client.wait_for_version(job, |_| {}).await?),
            (true, None) => self.latest().await?,
            (false, _) => None,
        };
        let result = version.as_ref().map(|version| version.result.read()).transpose();
        let result = result.map_err(anyhow::Error::from)?;
        let robot = self.to.robot.as_str();
        let placement = result
            .iter()
            .flat_map(|result| &result.maps)
            .find(|map| map.name == robot);
        if self.json {
            let line = json!({ "pushed": pushed, "version": version });
            say(&line.to_string())?;
        } else {
            let map = &pushed.map;
            let news = if pushed.created { "new" } else { "already known" };
            let (session, area) = (&map.session, map.known_area_m2);
            say(&format!(
                "{session}/{robot}: map {} ({news}, {area:.1} m2 known)",
                map.id
            ))?;
            for warning in &map.warnings {
                tell(&format!("warning: {warning}"))?;
            }
            if let Some((version, placement)) = version.as_ref().zip(placement) {
                say(&format!(
                    "version {}: {}",
                    version.number,
                    placements::sentence(placement)
                ))?;
            }
        }
        Ok(match placement.map(|placement| placement.status) {
            Some(api::PlacementStatus::NotPlaced) => Done::SomeNotPlaced,
            _ => Done::Entirely,
        })
    }

    /// The newest version, when a map that is pushed again causes no merge; `None` when there is none yet.
    async fn latest(&self) -> Result<Option<api::Version>, Failure> {
        match self
            .client
            .version(&self.to.session, crate::model::VersionSelector::Latest)
            .await
        {
            Ok(version) => Ok(Some(version)),
            Err(ClientError::Refused { problem, .. }) if problem.code == api::ProblemCode::VersionNotFound => Ok(None),
            Err(error) => Err(error.into()),
        }
    }
}

/// The files as they are: the server decodes them.
fn upload(files: MapFiles) -> Upload {
    Upload {
        map: FilePart::new(file_name(&files.path), files.yaml),
        image: FilePart::new(file_name(&files.image_path), files.image),
    }
}

/// Different for every robot and run, so that robots do not wait in step.
pub(super) fn random_seed() -> u64 {
    RandomState::new().build_hasher().finish()
}

fn now() -> Instant {
    Instant::now()
}
