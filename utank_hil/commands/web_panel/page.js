import * as view from "./view.js";

const at = (id) => document.getElementById(id);
const all = (selector) => [...document.querySelectorAll(selector)];
const SVG = "http://www.w3.org/2000/svg";
let state = null, number = 0, heardMs = -Infinity, triedMs = 0, late = false, source = null, answering = false;

function connect() {
  triedMs = performance.now();
  source?.close();
  source = new EventSource("states");
  source.onmessage = (event) => {
    state = JSON.parse(event.data);
    number = Number(event.lastEventId);
    heardMs = performance.now();
    answer();
    render();
  };
}

// Tells the panel that somebody sees this page: without it the panel falls silent.
async function answer() {
  if (answering) return;
  answering = true;
  try {
    late = (await post({ number })).status === 409;
  } catch {
    // No state will come either, and that is shown.
  } finally {
    answering = false;
  }
}

function post(order) {
  return fetch("order", { method: "POST", body: JSON.stringify(order), signal: AbortSignal.timeout(900) });
}

async function press(action) {
  for (let tries = 1; ; tries++) {
    try {
      const answered = await post({ number, action });
      text("answer", answered.ok ? "" : `${action} REFUSED: ${await answered.text()}`);
      return;
    } catch {
      text("answer", `${action.toUpperCase()} NOT SENT`);
      if (action !== "stop" || tries === 20) return;
      text("answer", "STOP NOT SENT, trying: use the hard-wired stop");
      await new Promise((next) => setTimeout(next, 250));
    }
  }
}

const lost = () => {
  if (performance.now() - heardMs > view.LOST_MS) return "what is shown is old; the panel is silent";
  return late ? "too slow: what is shown is old" : "";
};

function text(id, words) {
  const element = at(id);
  if (element.textContent !== words) element.textContent = words; // A live region speaks at each change.
}

function drawn(parent, kind, attributes, words = "") {
  const element = document.createElementNS(SVG, kind);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.textContent = words;
  parent.append(element);
  return element;
}

function drawDial(svg, limit) {
  const { most, step } = view.dial(limit);
  svg.replaceChildren();
  const line = (deg, from, to, kind) => {
    const [[x1, y1], [x2, y2]] = [view.onDial(deg, most, from), view.onDial(deg, most, to)];
    drawn(svg, "line", { x1, y1, x2, y2, class: kind });
  };
  const [[x1, y1], [x2, y2]] = [view.onDial(-most, most, 160), view.onDial(most, most, 160)];
  drawn(svg, "path", { d: `M${x1} ${y1}A160 160 0 0 1 ${x2} ${y2}`, class: "scale" });
  for (let deg = -most; deg <= most; deg += step) {
    line(deg, 160, 148, "tick");
    const [x, y] = view.onDial(deg, most, 178);
    drawn(svg, "text", { x, y: y + 6 }, String(Math.abs(deg)));
  }
  for (const deg of [-limit, limit]) line(deg, 166, 140, "limit");
  drawn(svg, "text", { x: 48, y: 165 }, "PORT");
  drawn(svg, "text", { x: 352, y: 165 }, "STBD");
  drawn(svg, "path", { d: "M200 62 L184 100 L200 92 L216 100 Z", class: "pointer" });
  svg.dataset.most = most;
}

function showDial(name, deg, limit, figureId, sideId) {
  const svg = at(name);
  if (svg.dataset.limit !== String(limit)) drawDial(svg, limit);
  svg.dataset.limit = limit;
  const { size, side } = view.angle(deg);
  text(figureId, size);
  text(sideId, side);
  const passed = deg !== null && Math.abs(deg) > limit;
  svg.classList.toggle("passed", passed);
  at(figureId).classList.toggle("passed", passed);
  const pointer = svg.querySelector(".pointer");
  pointer.setAttribute("visibility", deg === null ? "hidden" : "visible");
  const turn = 65 * (view.share(deg, Number(svg.dataset.most)) ?? 0);
  pointer.setAttribute("transform", `rotate(${turn} 200 205)`);
}

function showTank(id, level, { full_m: full, level_m: limit }) {
  const tank = at(id), place = (value) => `${50 + 50 * view.share(value, full)}%`;
  tank.querySelector(".fill").style.height = level === null ? "0" : place(level);
  tank.querySelector(".limit").style.bottom = place(limit);
  tank.classList.toggle("passed", level !== null && level > limit);
}

function showList(id, rows) {
  const list = at(id);
  const wanted = JSON.stringify(rows);
  if (list.dataset.shown === wanted) return;
  list.dataset.shown = wanted;
  list.replaceChildren(...rows.flatMap((row) => row.map((words, place) => {
    const element = document.createElement(place ? "dd" : "dt");
    element.textContent = words;
    return element;
  })));
}

function showAlarms() {
  const found = view.alarms(state), list = at("alarm-list");
  at("no-alarms").hidden = found.length > 0;
  text("alarm-count", found.length ? `(${found.length})` : "");
  list.replaceChildren(...found.map((alarm) => {
    const item = document.createElement("li"), name = document.createElement("b");
    item.dataset.tone = alarm.tone;
    name.textContent = alarm.code;
    const since = alarm.age_s === null ? "" : `, ${alarm.age_s.toFixed(0)} s ago`;
    const [happened, remedy] = [alarm.words[0], alarm.words[1]].map((words) => {
      const line = document.createElement("p");
      line.textContent = words;
      return line;
    });
    item.append(name, `${alarm.status}${since}`, happened, remedy);
    return item;
  }));
}

function render() {
  const why = lost(), { word, note, tone, dead } = view.headline(state, why);
  document.body.classList.toggle("lost", dead);
  text("mode", word);
  at("mode").dataset.tone = tone;
  text("note", dead ? "" : note);
  text("lost-word", dead ? word : "");
  text("alarm-line", dead ? "" : view.alarmLine(state));
  at("arm").setAttribute("aria-disabled", String(view.whyNotArm(state, why) !== ""));
  if (!state || dead) return;
  const { figures, ship } = state;
  text("ship", ship.name);
  showDial("roll-dial", figures.roll_deg, ship.roll_deg, "roll", "roll-side");
  showDial("heel-dial", figures.heel_deg, ship.heel_deg, "heel-figure", "heel-side");
  text("heel-label", `HEEL, MEAN OF ${figures.heeled_s.toFixed(0)} S`);
  const heel = view.angle(figures.heel_deg);
  text("home-heel", `${heel.size} ${heel.side}`);
  text("rms", view.figure(figures.roll_rms_deg, 1, "°"));
  text("passive", view.passiveText(figures));
  text("asked", view.figure(figures.asked_kpa, 0, " kPa"));
  text("given", view.figure(figures.given_kpa, 0, " kPa"));
  text("pressure-most", `±${ship.pressure_kpa.toFixed(0)} kPa`);
  const given = 50 * (view.share(figures.given_kpa, ship.pressure_kpa) ?? 0);
  const fill = at("pressure-bar").querySelector(".fill").style;
  [fill.left, fill.width] = [`${50 + Math.min(0, given)}%`, `${Math.abs(given)}%`];
  const mark = at("pressure-bar").querySelector(".mark").style;
  const asked = view.share(figures.asked_kpa, ship.pressure_kpa);
  [mark.left, mark.visibility] = [`${50 + 50 * (asked ?? 0)}%`, asked === null ? "hidden" : "visible"];
  text("load", figures.load === null ? view.NONE : `${(100 * figures.load).toFixed(0)} %`);
  text("power", figures.power_kw === null ? "" : `${figures.power_kw.toPrecision(2) * 1} kW`);
  at("load-bar").querySelector(".fill").style.width = `${100 * (view.share(figures.load, 1) ?? 0)}%`;
  at("load-bar").classList.toggle("passed", figures.pump_limited);
  text("port", view.figure(figures.port_m, 2, " m"));
  text("starboard", view.figure(figures.starboard_m, 2, " m"));
  text("level-limit", `limit ${ship.level_m.toFixed(2)} m above still water`);
  showTank("port-tank", figures.port_m, ship);
  showTank("starboard-tank", figures.starboard_m, ship);
  showList("heel-list", view.heelList(state));
  showList("engineer-list", view.engineerList(state));
  showAlarms();
  text("said", state.said.lines.join(" · "));
}

function showPage(name) {
  for (const section of all("main section")) section.hidden = section.id !== name;
  for (const button of all("nav button")) {
    if (button.dataset.page === name) button.setAttribute("aria-current", "page");
    else button.removeAttribute("aria-current");
  }
}

function showPalette(name) {
  document.documentElement.dataset.palette = name;
  at("palette").querySelector("span").textContent = name;
  localStorage.setItem("palette", name);
}

const arm = at("arm");
let holding = 0;
function hold() {
  const why = view.whyNotArm(state, lost());
  text("answer", why ? `not armed: ${why}` : "");
  if (why || holding) return;
  arm.classList.add("holding");
  holding = setTimeout(() => { release(); press("arm"); }, view.HOLD_MS);
}
function release() {
  clearTimeout(holding);
  holding = 0;
  arm.classList.remove("holding");
}
arm.addEventListener("pointerdown", hold);
for (const end of ["pointerup", "pointerleave", "pointercancel", "blur"]) arm.addEventListener(end, release);
window.addEventListener("blur", release);
arm.addEventListener("contextmenu", (event) => event.preventDefault());

at("stop").addEventListener("pointerdown", () => press("stop")); // A finger may slide off before it is lifted.
for (const button of all("[data-action]")) button.addEventListener("click", (event) => {
  if (button.id !== "stop" || event.detail === 0) press(button.dataset.action); // 0: by a key.
});
for (const button of all("nav button")) button.addEventListener("click", () => showPage(button.dataset.page));
at("palette").addEventListener("click", () => {
  const next = view.PALETTES.indexOf(document.documentElement.dataset.palette) + 1;
  showPalette(view.PALETTES[next % view.PALETTES.length]);
});

document.addEventListener("keydown", (event) => {
  const key = view.shortcut(event);
  const onArm = document.activeElement === arm && [" ", "Enter"].includes(event.key);
  if (key === "a" || onArm) {
    event.preventDefault();
    if (!event.repeat) hold();
  } else if (key && !event.repeat) {
    document.querySelector(`[data-key="${CSS.escape(key)}"]`)?.click();
  }
});
document.addEventListener("keyup", release);

let audio = null;
document.addEventListener("pointerdown", () => { audio ??= new AudioContext(); }); // Browsers want a touch first.
setInterval(() => {
  if (!audio || lost() || !view.sounds(state)) return;
  const tone = audio.createOscillator();
  tone.connect(audio.destination);
  tone.start();
  tone.stop(audio.currentTime + 0.3);
}, 2000);

setInterval(() => {
  render();
  const now = performance.now();
  if (now - heardMs > 2000 && now - triedMs > 2000) connect();
}, 100);
const kept = localStorage.getItem("palette");
showPalette(view.PALETTES.includes(kept) ? kept : "day");
connect();
