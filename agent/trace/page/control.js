
// What is picked, links to it, search, keys, light and dark.

let picked = 0, tab = "why", hits = [], byStep = false, anchor = 0;

function details() {
  const row = rows[picked];
  const panels = { why: whyPanel, plan: () => planPanel(row.last), changes: () => changesPanel(row), message: () => messagePanel(row), model: () => modelPanel(row.last) };
  at("details").replaceChildren(...panels[tab]());
  at("details").setAttribute("aria-labelledby", `tab-${tab}`);
  for (const name of tabs) {
    at(`tab-${name}`).setAttribute("aria-selected", name === tab);
    at(`tab-${name}`).tabIndex = name === tab ? 0 : -1;
  }
}

/// Picks a row, and shows all that stands at it.
function pick(index, { step = false, link = true } = {}) {
  if (!rows.length) return;
  picked = Math.min(Math.max(index, 0), rows.length - 1);
  byStep = step;
  const row = rows[picked], number = stepOf(row.last);
  show(picked);
  soon();
  at("frame").replaceChildren(...framePanel(row.last));
  at("memory").replaceChildren(...memoryPanel(row.last).filter(part => part));
  details();
  at("slider").value = number + 1;
  const name = number < 0 ? "before the first step" : `step ${number + 1} of ${steps.length}: ${steps[number].title}`;
  at("step").textContent = `${name}, at ${seconds(row.t)}`;
  at("step").title = name;
  at("slider").setAttribute("aria-valuetext", name);
  if (link) setLink(step && number >= 0 ? `step=${number + 1}` : `seq=${row.seq}`);
}

function setLink(what) {
  const link = `#${what}${tab === "why" ? "" : `&tab=${tab}`}`;
  if (location.hash !== link) history.replaceState(null, "", link);
}

function pickStep(number, options = {}) {
  if (number < 1) return pick(0, options);
  const step = steps[Math.min(number, steps.length) - 1];
  if (step) pick(rowOf(step.seq), { step: true, ...options });
}

function goTo(seq) {
  const index = rowOf(seq);
  if (index >= 0) pick(index);
}

function choose(name) {
  tab = name;
  details();
  setLink(byStep ? `step=${stepOf(rows[picked].last) + 1}` : `seq=${rows[picked].seq}`);
}

function note(...texts) {
  at("notes").hidden = !texts.length;
  at("notes").replaceChildren(...texts.map(text => make("div", {}, text)));
}
const standing = () => [...(data.cut ? [`CUT: ${data.cut}; what stands before is shown`] : []), ...data.left_out.map(what => `Left out: ${what}`)];

/// Follows the link in the address bar.
function follow() {
  const wanted = new URLSearchParams(location.hash.slice(1));
  note(...standing());
  if (tabs.includes(wanted.get("tab"))) tab = wanted.get("tab");
  if (wanted.has("step")) {
    const number = Number(wanted.get("step"));
    if (Number.isInteger(number) && number >= 1 && number <= steps.length) return pickStep(number, { link: false });
    note(...standing(), `There is no step ${wanted.get("step")}: the run has ${steps.length}`);
  } else if (wanted.has("seq")) {
    const index = rowOf(Number(wanted.get("seq")));
    if (index >= 0) return pick(index, { link: false });
    note(...standing(), `There is no message ${wanted.get("seq")}`);
  }
  if (steps.length) pickStep(1, { link: false }); else pick(0, { link: false });
}

// ---- search

function search(jump) {
  words = at("query").value.trim().toLowerCase();
  hits = words ? rows.map((_, index) => index).filter(index => textOf(index).includes(words)) : [];
  if (words && jump && hits.length) pick(hits.find(index => index >= anchor) ?? hits[0]);
  found();
  soon();
}
function found() {
  const place = hits.indexOf(picked);
  const { kind, line } = rows[picked];
  const where = `${kind} ${line}`.toLowerCase().includes(words) ? "" : ", in its body";
  at("found").textContent = !words ? "" : !hits.length ? "nothing" : place < 0 ? `${hits.length} found` : `${place + 1} of ${hits.length}${where}`;
}
function nextHit(way) {
  if (!hits.length) return;
  const later = hits.filter(index => way > 0 ? index > picked : index < picked);
  pick(way > 0 ? later[0] ?? hits[0] : later.at(-1) ?? hits.at(-1));
  found();
}
// While a word is typed, the search goes on from where it began.
at("query").addEventListener("focus", () => { anchor = picked; });
at("query").addEventListener("input", () => search(true));
at("query").addEventListener("keydown", event => {
  if (event.key === "Enter") { event.preventDefault(); nextHit(event.shiftKey ? -1 : 1); }
  if (event.key === "Escape") { at("query").value = ""; search(false); lanes.focus(); }
  event.stopPropagation();
});

// ---- light and dark

/// What was chosen before; pages from a file may have no store.
function stored(value) {
  try {
    if (value !== undefined) localStorage.setItem("acm-theme", value);
    return localStorage.getItem("acm-theme");
  } catch { return null; }
}
const system = matchMedia("(prefers-color-scheme: dark)");
function theme(name) {
  const shown = name ?? (system.matches ? "dark" : "light");
  document.documentElement.dataset.theme = shown;
  at("theme").textContent = shown === "dark" ? "Light" : "Dark";
  soon();
}
function switchTheme() {
  const other = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
  stored(other);
  theme(other);
}
system.addEventListener("change", () => theme(stored()));
at("theme").addEventListener("click", switchTheme);

// ---- keys

const perPage = () => Math.max(1, Math.floor(lanes.clientHeight / HEIGHT) - 2);
const keys = {
  ArrowUp: () => pick(picked - 1), ArrowDown: () => pick(picked + 1),
  ArrowLeft: () => {
    const number = stepOf(rows[picked].last) + 1;
    pickStep(number >= 1 && rowOf(steps[number - 1].seq) < picked ? number : number - 1);
  },
  ArrowRight: () => pickStep(stepOf(rows[picked].last) + 2),
  PageUp: () => pick(picked - perPage()), PageDown: () => pick(picked + perPage()),
  Home: () => pick(0), End: () => pick(rows.length - 1),
  c: () => { const [, before] = chainOf(picked); if (before !== undefined) pick(before); },
  w: () => choose("why"), p: () => choose("plan"), m: () => choose("message"), h: () => choose("changes"), r: () => choose("model"),
  t: switchTheme, "/": () => { at("query").focus(); at("query").select(); }, "?": () => at("keys").showModal(),
};
document.addEventListener("keydown", event => {
  if (event.ctrlKey || event.metaKey || event.altKey || at("keys").open || !rows.length) return;
  const inTabs = event.target.role === "tab", way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (event.target === at("slider") && event.key.startsWith("Arrow")) return;
  if (inTabs && way) {
    choose(tabs[(tabs.indexOf(tab) + way + tabs.length) % tabs.length]);
    at(`tab-${tab}`).focus();
  } else if (event.target === at("details") && /Arrow(Up|Down)|Page|Home|End/.test(event.key)) {
    return;
  } else if (keys[event.key]) {
    keys[event.key]();
  } else {
    return;
  }
  event.preventDefault();
});
for (const name of tabs) {
  at(`tab-${name}`).addEventListener("click", event => {
    choose(name);
    // Who uses the mouse wants the arrow keys for steps; who came here by keys wants them for tabs.
    if (event.detail > 0) lanes.focus({ preventScroll: true });
  });
}
at("slider").addEventListener("input", () => pickStep(Number(at("slider").value)));
at("back").addEventListener("click", () => keys.ArrowLeft());
at("on").addEventListener("click", () => keys.ArrowRight());
at("help").addEventListener("click", () => at("keys").showModal());
addEventListener("hashchange", follow);

// ---- begin

at("title").textContent = `${data.run.scenario ?? "?"}  seed ${data.run.seed ?? "?"}`;
document.title = `${at("title").textContent} - ACM trace`;
at("ending").textContent = data.ending;
at("ending").className = data.ending === "solved" ? "good" : "bad";
const count = rows.length ? rows.at(-1).last : 0;
at("facts").textContent = `${data.run.method ?? "?"}, sensor ${data.run.sensor ?? "?"}, ${steps.length} steps, ${count} messages, ${frames.length} frames, acm ${data.run.version ?? "?"}`;
at("slider").max = steps.length;
at("tab-model").hidden = !calls.length;
theme(stored());
heads();
if (rows.length) follow(); else note(...standing(), "The trace has no message.");
