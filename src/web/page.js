"use strict";

// The chosen session stands in the fragment, so that a link leads to it. Everything shown is written as text, never as
// HTML: names and reasons come from outside.

const at = (id) => document.getElementById(id);
const state = { session: null, events: null, newest: 0, wanted: 0, shown: 0, follow: true };

async function read(path) {
  const response = await fetch(path, { headers: { accept: "application/json" } });
  if (!response.ok) throw new Error(`${path}: ${response.status}`);
  return response.json();
}

function element(name, text, className) {
  const made = document.createElement(name);
  if (text !== undefined) made.textContent = text;
  if (className) made.className = className;
  return made;
}

const number = (value, digits) => (value === null || value === undefined ? "–" : value.toFixed(digits));
const when = (time) => new Date(time).toLocaleString();

function link(kind, text) {
  at("link").className = `link ${kind}`;
  at("link").textContent = text;
}

function lost(error) {
  link("lost", error.message);
}

async function listSessions() {
  const sessions = [];
  let token = "";
  do {
    const page = await read(`/v1/sessions?page_size=200${token && `&page_token=${encodeURIComponent(token)}`}`);
    sessions.push(...page.items);
    token = page.next_page_token;
  } while (token && sessions.length < 1000);
  at("sessions").replaceChildren(
    ...sessions.map((session) => {
      const button = element("button");
      button.type = "button";
      button.append(element("strong", session.title || session.id), element("small", when(session.updated_at)));
      button.setAttribute("aria-current", String(session.id === state.session));
      button.addEventListener("click", () => {
        location.hash = session.id;
      });
      const item = element("li");
      item.append(button);
      return item;
    }),
  );
  at("no-sessions").hidden = sessions.length > 0;
  return sessions;
}

function choose(session) {
  if (state.events) state.events.close();
  Object.assign(state, { session, events: null, newest: 0, wanted: 0, shown: 0, follow: true });
  at("welcome").hidden = session !== null;
  at("session").hidden = session === null;
  for (const id of ["waiting", "job", "figure", "placements", "files"]) at(id).hidden = true;
  at("name").textContent = session ?? "";
  at("about").textContent = "";
  steps();
  if (session === null) return;
  const events = new EventSource(`/v1/sessions/${encodeURIComponent(session)}/events`);
  state.events = events;
  events.addEventListener("open", () => link("live", "live"));
  events.addEventListener("error", () => link("lost", "reconnecting"));
  events.addEventListener("session", (event) => showSession(JSON.parse(event.data)));
  events.addEventListener("job", (event) => showJob(JSON.parse(event.data)));
  events.addEventListener("version", (event) => {
    state.newest = Math.max(state.newest, JSON.parse(event.data).number);
    if (state.follow) showVersion(state.newest).catch(lost);
    else steps();
  });
}

// The event of a session comes after those of its versions.
function showSession(session) {
  at("waiting").hidden = state.newest > 0;
  at("name").textContent = session.title || session.id;
  read(`/v1/sessions/${encodeURIComponent(session.id)}/robots`)
    .then(({ items }) => {
      if (state.session !== session.id) return;
      const maps = items.reduce((sum, robot) => sum + robot.maps, 0);
      const count = (n, word) => `${n} ${word}${n === 1 ? "" : "s"}`;
      const anchor = session.anchor ? `anchor ${session.anchor}` : "no anchor yet";
      const about = [count(items.length, "robot"), count(maps, "map"), anchor, session.method.name];
      at("about").textContent = about.join(" · ");
    })
    .catch(lost);
}

function showJob(job) {
  at("job").hidden = ["succeeded", "cancelled"].includes(job.state);
  at("job").classList.toggle("failed", job.state === "failed");
  at("job-progress").hidden = job.state === "failed";
  at("job-progress").value = job.progress;
  const why = job.error ? `: ${job.error.message}` : "";
  const running = `merging: ${job.stage ?? "begins"}`;
  at("job-text").textContent = job.state === "running" ? running : `merge ${job.state}${why}`;
}

function steps() {
  at("version").textContent = state.shown ? `version ${state.shown} of ${state.newest}` : "";
  at("older").disabled = state.shown <= 1;
  at("newer").disabled = state.shown >= state.newest;
  at("older").hidden = at("newer").hidden = state.newest === 0;
}

async function showVersion(wanted) {
  const session = state.session;
  state.wanted = wanted;
  const base = `/v1/sessions/${encodeURIComponent(session)}/versions/${wanted}`;
  const version = await read(base);
  // answers may overtake each other
  if (state.session !== session || state.wanted !== wanted) return;
  state.shown = wanted;
  steps();
  const { anchor, maps, fused, timings } = version.result;
  at("overlay").src = `${base}/overlay.png`;
  at("overlay-link").href = `${base}/overlay.png`;
  const metres = (cells) => (cells * fused.resolution).toFixed(1);
  at("caption").textContent =
    `${metres(fused.width)} × ${metres(fused.height)} m at ${fused.resolution} m a cell, in the frame of ${anchor} · ` +
    `${when(version.created_at)} · merged in ${timings.total_seconds.toFixed(2)} s`;
  at("rows").replaceChildren(...maps.map(placementRow));
  const files = ["map.zip", "map.yaml", "map.png", "map.pgm", "overlay.png", "transforms", "occupancy_grid.json"];
  at("files").replaceChildren(
    ...files.map((file) => {
      const anchor = element("a", file);
      anchor.href = `${base}/${file}`;
      return anchor;
    }),
  );
  for (const id of ["figure", "placements", "files"]) at(id).hidden = false;
  at("waiting").hidden = true;
}

function placementRow(map) {
  const row = element("tr");
  const mark = element("td");
  mark.append(element("span", map.status === "placed" ? "placed" : "not placed", `mark ${map.status}`));
  const { pose } = map;
  const anchor = map.basis === "anchor";
  row.append(
    element("td", map.name),
    mark,
    element("td", pose ? `${number(pose.x, 2)}, ${number(pose.y, 2)}` : "–", "n"),
    element("td", pose ? `${((pose.yaw * 180) / Math.PI).toFixed(1)}°` : "–", "n"),
    element("td", number(map.verification_index, 2), "n"),
    element("td", map.overlap === null ? "–" : `${Math.round(map.overlap * 100)} %`, "n"),
    element("td", anchor ? "–" : String(map.supporting_pairs.length), "n"),
    element("td", map.reason ? map.reason.message : anchor ? "the anchor: its frame is the session's" : "", "hint"),
  );
  return row;
}

async function refresh() {
  try {
    const sessions = await listSessions();
    if (!state.events) link("live", "live");
    const named = decodeURIComponent(location.hash.slice(1));
    const wanted = named || (sessions.length > 0 ? sessions[0].id : null);
    if (wanted !== state.session) {
      choose(wanted);
      await listSessions();
    }
  } catch (error) {
    lost(error);
  }
}

function start() {
  at("example").textContent = ["r1", "r2"]
    .map((r) => `curl -F map=@${r}.yaml -F image=@${r}.pgm ${location.origin}/v1/sessions/hall/robots/${r}/maps`)
    .join("\n");
  at("welcome").hidden = false;
  const step = (by) => () => {
    const wanted = state.shown + by;
    state.follow = wanted === state.newest;
    showVersion(wanted).catch(lost);
  };
  at("older").addEventListener("click", step(-1));
  at("newer").addEventListener("click", step(1));
  window.addEventListener("hashchange", refresh);
  setInterval(refresh, 5000);
  refresh();
}

start();
