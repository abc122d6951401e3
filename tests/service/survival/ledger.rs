//! What was acknowledged, and the audit that compares it with what a server tells.

use std::collections::{BTreeMap, BTreeSet};

use mapweld::api::{Job, Map, Page, Pushed, VersionSummary};
use mapweld::codec::encode_png;
use mapweld::model::{JobState, MapId};
use reqwest::Client;
use serde::de::DeserializeOwned;

use super::replica::{ended_job, read, text_of};
use crate::http::rooms::scrap;

/// A map that a server has said to have.
#[derive(Debug, Clone)]
pub(super) struct Acknowledged {
    pub(super) seed: u32,
    pub(super) pushed: Pushed,
}

/// All that was acknowledged, by session, and the versions that were ever seen.
#[derive(Debug, Default)]
pub(super) struct Ledger {
    acknowledged: BTreeMap<String, Vec<Acknowledged>>,
    /// Merges that were asked for, beside those that uploads cause.
    merges: BTreeMap<String, Vec<Job>>,
    seen: BTreeMap<(String, u32), String>,
}

/// What an audit has counted.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(super) struct Counted {
    pub(super) maps: usize,
    pub(super) jobs: usize,
    pub(super) versions: usize,
}

impl Ledger {
    pub(super) fn add(&mut self, acknowledged: Acknowledged) {
        let session = acknowledged.pushed.map.session.to_string();
        self.acknowledged.entry(session).or_default().push(acknowledged);
    }

    pub(super) fn add_merge(&mut self, job: Job) {
        self.merges.entry(job.session.to_string()).or_default().push(job);
    }

    pub(super) fn uploads(&self) -> usize {
        self.acknowledged.values().map(Vec::len).sum()
    }

    /// The jobs that are known from acknowledgements.
    pub(super) fn jobs(&self) -> usize {
        let of_uploads = self.acknowledged.values().flatten().filter_map(|ack| ack.pushed.job);
        let asked_for = self.merges.values().flatten().map(|job| job.id);
        of_uploads.chain(asked_for).collect::<BTreeSet<_>>().len()
    }

    /// Waits until every job has ended, then compares everything. Panics at the first thing that is not as it was
    /// promised.
    pub(super) async fn audit(&mut self, client: &Client, url: &str) -> Counted {
        self.audit_of(client, url, "").await
    }

    /// As [`Self::audit`], of the sessions whose names begin like this.
    pub(super) async fn audit_of(&mut self, client: &Client, url: &str, begins: &str) -> Counted {
        let mut counted = Counted::default();
        let sessions = self.acknowledged.keys().filter(|session| session.starts_with(begins));
        for session in sessions.cloned().collect::<Vec<_>>() {
            let here = self.audit_session(client, url, &session).await;
            counted.maps += here.maps;
            counted.jobs += here.jobs;
            counted.versions += here.versions;
        }
        counted
    }

    async fn audit_session(&mut self, client: &Client, url: &str, session: &str) -> Counted {
        let below = format!("{url}/v1/sessions/{session}");
        let jobs = self.settled_jobs(client, url, session).await;
        let versions = self.gap_free_versions(client, &below, session, &jobs).await;
        let maps: BTreeMap<MapId, Map> = all::<Map>(client, &format!("{below}/maps"))
            .await
            .into_iter()
            .map(|map| (map.id, map))
            .collect();
        are_numbered_without_gaps(&maps);
        for Acknowledged { seed, pushed } in &self.acknowledged[session] {
            let kept = maps.get(&pushed.map.id);
            assert_eq!(kept, Some(&pushed.map), "an acknowledged map is lost or changed");
            let picture = client.get(format!("{below}/maps/{}.png", pushed.map.id)).send().await;
            let picture = picture.expect("an answer").bytes().await.expect("a picture");
            assert_eq!(
                picture,
                encode_png(&scrap(*seed)),
                "the cells of an acknowledged map are lost or changed"
            );
            let job = pushed.job.expect("the session merges by itself");
            let version = jobs[&job.to_string()].version.expect("it succeeded").get();
            let inputs = &versions[version as usize - 1].inputs;
            let input = inputs.iter().find(|input| input.robot == pushed.map.robot);
            let taken = &maps[&input.expect("the robot is in the version").map];
            assert!(
                taken.sequence >= pushed.map.sequence,
                "version {version} was to take in {pushed:?}, and took {taken:?}"
            );
        }
        Counted {
            maps: maps.len(),
            jobs: jobs.len(),
            versions: versions.len(),
        }
    }

    /// The jobs of a session by id: all have ended, all well, and none that was acknowledged is missing.
    async fn settled_jobs(&self, client: &Client, url: &str, session: &str) -> BTreeMap<String, Job> {
        let mut jobs = BTreeMap::new();
        for job in all::<Job>(client, &format!("{url}/v1/sessions/{session}/merges")).await {
            let job = if job.state.is_terminal() {
                job
            } else {
                ended_job(client, url, job.id).await
            };
            assert_eq!(job.state, JobState::Succeeded, "{job:?}");
            jobs.insert(job.id.to_string(), job);
        }
        for job in self.merges.get(session).into_iter().flatten() {
            assert!(
                jobs.contains_key(&job.id.to_string()),
                "an acknowledged merge is lost: {job:?}"
            );
        }
        jobs
    }

    /// The versions from the first on: numbered without gaps, one of each job, and each as it was ever seen.
    async fn gap_free_versions(
        &mut self,
        client: &Client,
        below: &str,
        session: &str,
        jobs: &BTreeMap<String, Job>,
    ) -> Vec<VersionSummary> {
        let mut versions = all::<VersionSummary>(client, &format!("{below}/versions")).await;
        versions.reverse();
        for (before, version) in versions.iter().enumerate() {
            let number = version.number.get();
            assert_eq!(
                number as usize,
                before + 1,
                "a version of {session} is missing or doubled"
            );
            assert_eq!(version.parent.map_or(0, |parent| parent.get() as usize), before);
            let job = &jobs[&version.job.to_string()];
            assert_eq!(
                job.version,
                Some(version.number),
                "a version that its job does not know"
            );
            let whole = client.get(format!("{below}/versions/{number}")).send().await;
            let whole = text_of(whole.expect("an answer")).await;
            let first = self
                .seen
                .entry((session.to_owned(), number))
                .or_insert_with(|| whole.clone());
            assert_eq!(*first, whole, "version {number} of {session} has changed");
        }
        let publishers: BTreeSet<_> = versions.iter().map(|version| version.job).collect();
        assert_eq!(publishers.len(), versions.len(), "a job has published twice");
        assert_eq!(jobs.len(), versions.len(), "a job has published nothing");
        versions
    }
}

fn are_numbered_without_gaps(maps: &BTreeMap<MapId, Map>) {
    let mut by_robot: BTreeMap<_, BTreeSet<u32>> = BTreeMap::new();
    for map in maps.values() {
        let fresh = by_robot.entry(map.robot.to_string()).or_default().insert(map.sequence);
        assert!(fresh, "a number of a robot's maps is doubled: {map:?}");
    }
    for (robot, numbers) in by_robot {
        let last = u32::try_from(numbers.len()).expect("few");
        assert_eq!(numbers.last(), Some(&last), "the maps of {robot} have a gap");
    }
}

/// Every item of a list.
async fn all<T: DeserializeOwned>(client: &Client, list: &str) -> Vec<T> {
    let mut items = Vec::new();
    let mut page: Page<T> = read(client, format!("{list}?page_size=200")).await;
    loop {
        items.append(&mut page.items);
        let Some(token) = page.next_page_token else {
            return items;
        };
        page = read(client, format!("{list}?page_size=200&page_token={token}")).await;
    }
}
