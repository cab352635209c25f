// What the page shows of a state, and when: no document, no clock.

export const LOST_MS = 700; // Without a state for so long nothing shown is of now; states come each 100 ms.
export const HOLD_MS = 1000; // Time that ARM is held: no touch in passing.
export const PALETTES = ["day", "dusk", "night"];
export const NONE = "—";

export function figure(value, digits, unit = "") {
  return value === null || value === undefined ? NONE : value.toFixed(digits).replace("-", "−") + unit;
}

// An angle, positive starboard down, as its size and its side.
export function angle(deg) {
  if (deg === null || deg === undefined) return { size: NONE, side: "" };
  const size = Math.abs(deg).toFixed(1);
  return { size: `${size}°`, side: size === "0.0" ? "" : deg > 0 ? "STBD" : "PORT" };
}

// Greatest angle of a dial whose limit is to be seen, and the steps of its figures.
export function dial(limit) {
  const step = limit > 12 ? 5 : 2;
  return { most: step * Math.ceil((limit * 1.2) / step), step };
}

// Point of a dial of radius `r` about (200, 205) that spans 65 degrees to each side.
export function onDial(deg, most, r) {
  const turn = (Math.max(-1, Math.min(1, deg / most)) * 65 * Math.PI) / 180;
  return [200 + r * Math.sin(turn), 205 - r * Math.cos(turn)];
}

export function share(value, most) {
  if (value === null || value === undefined || !most) return null;
  return Math.max(-1, Math.min(1, value / most));
}

// The large word, why, and how it looks. `lost` is a reason why no state is of now.
export function headline(state, lost) {
  if (lost || !state) return { word: "NO CONNECTION", note: lost || "", tone: "alarm", dead: true };
  if (!state.heard) return { word: "NO CONTROLLER", note: "", tone: "alarm", dead: true };
  const notes = [];
  if (state.stopping) notes.push("stop is held until it is answered");
  if (!state.in_command) notes.push("the other station has the command");
  if (state.degraded) notes.push("half the pressure");
  if (state.retuning && state.retuning !== "IDLE") notes.push(`retuning: ${state.retuning.toLowerCase()}`);
  if (state.fault && state.mode !== "FAULT") notes.push(`not armed: ${state.fault[0]}`);
  const tone = { ACTIVE: "good", FAULT: "alarm" }[state.mode] ?? "plain";
  return { word: state.mode ?? "UNKNOWN MODE", note: notes.join("; "), tone, dead: false };
}

// Why ARM does nothing now; empty if it does. The panel judges it again.
export function whyNotArm(state, lost) {
  if (lost || !state) return "no connection";
  if (!state.heard) return "no controller is heard";
  if (state.stopping) return "the stop is not answered yet";
  if (!state.in_command) return "the other station has the command";
  return { ACTIVE: "it is in charge", FAULT: "reset the fault first", INIT: "the controller is not ready" }[state.mode] ?? "";
}

// Alarms as they are listed: red as long as the cause lasts and nobody has accepted.
export function alarms(state) {
  return (state?.alarms ?? []).map((alarm) => ({
    ...alarm,
    tone: alarm.accepted ? "caution" : alarm.lasts ? "alarm" : "plain",
    status: alarm.accepted ? "accepted" : alarm.lasts ? "not accepted" : "cause gone, not accepted",
  }));
}

export function alarmLine(state) {
  const open = alarms(state).filter((alarm) => !alarm.accepted);
  if (!open.length) return "";
  return `${open[0].code}${open.length > 1 ? ` and ${open.length - 1} more` : ""}: accept?`;
}

// Whether the alarm sounds: until it is accepted or its cause is gone.
export function sounds(state) {
  return alarms(state).some((alarm) => alarm.tone === "alarm");
}

export function passiveText(figures) {
  const { roll_rms_deg: roll, passive_rms_deg: passive } = figures;
  return roll === null || passive === null ? "" : `of ${passive.toFixed(1)}° with the pump off`;
}

export function heelList(state) {
  const { figures, ship } = state;
  const least = ship.least_gm_m === null ? "" : `, at least ${ship.least_gm_m.toFixed(2)} m`;
  return [
    ["Heel limit", figure(ship.heel_deg, 1, "°")],
    ["GM as identified", figure(figures.gm_m, 2, " m") + least],
    ["Roll period", figure(figures.roll_period_s, 1, " s")],
    ["Water", water(figures)],
  ];
}

function water({ port_m: port, starboard_m: starboard }) {
  if (port === null || starboard === null) return NONE;
  const up = (starboard - port) / 2;
  return `${Math.abs(up).toFixed(2)} m up to ${up < 0 ? "port" : "starboard"}`;
}

export function engineerList(state) {
  const { figures, versions } = state;
  return [
    ["Fault", state.fault ? `${state.fault[0]}: ${state.fault[1]} ${state.fault[2]}` : "none"],
    ["This station", state.station + (state.in_command ? ", in command" : "")],
    ["Drive", figures.drive ? figures.drive.toLowerCase().replaceAll("_", " ") : NONE],
    ["Drive at its limit", figures.drive ? (figures.pump_limited ? "yes" : "no") : NONE],
    ["Command at its limit", state.saturated ? "yes" : "no"],
    ["Valve", figures.valve === null ? NONE : `${(100 * figures.valve).toFixed(0)} % open`],
    ["High-level switch", figures.high_level ? "CLOSED OR BROKEN" : figures.high_level === null ? NONE : "open"],
    ["Retuning", (state.retuning ?? NONE).toLowerCase()],
    ["Bus load", state.bus_load === null ? NONE : `${(100 * state.bus_load).toFixed(0)} %`],
    ["Versions", versions ? `catalogue ${versions[0]}, ship ${versions[1]}` : NONE],
  ];
}

// Key of a button, from what is typed; empty for what is no shortcut.
export function shortcut(event) {
  if (event.ctrlKey || event.altKey || event.metaKey) return "";
  return event.key === "Escape" ? "s" : event.key.length === 1 ? event.key.toLowerCase() : "";
}
