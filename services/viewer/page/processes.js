// The table of processes and the line about the filter.

/** Time for which a restarted process is shown red, ms. */
const BROKEN_MS = 2500;
const LABELS = { backoff: "restarting" };

/** Shows a status. Rows are updated in place, so that a selection is not lost. */
export function showProcesses(body, { processes }) {
  while (body.rows.length > processes.length) body.deleteRow(-1);
  processes.forEach((process, index) => fill(body.rows[index] ?? newRow(body), process));
}

function newRow(body) {
  const row = body.insertRow();
  for (let cell = 0; cell < 5; cell++) row.insertCell();
  row.cells[0].append(element("b"), " ", element("span", "pid"), element("span", "note"));
  row.cells[1].append(element("span", "state"));
  return row;
}

function element(name, className = "") {
  const it = document.createElement(name);
  it.className = className;
  return it;
}

function fill(row, process) {
  // A restart is faster than the eye: the row stays red for a while.
  if (process.restarts > Number(row.dataset.restarts ?? process.restarts)) row.dataset.until = performance.now() + BROKEN_MS;
  row.dataset.restarts = process.restarts;
  const broken = ["backoff", "failed"].includes(process.state) || performance.now() < Number(row.dataset.until ?? 0);
  const className = broken ? `${process.state} broken` : process.state;
  if (row.className !== className) row.className = className;
  row.dataset.process = process.name;
  row.title = `${process.restarts} restarts, ${process.lost} messages lost, ${process.refused} refused, `
    + `${(process.resident_bytes / 1e6).toFixed(1)} MB`;
  const [name, pid, note] = row.cells[0].children;
  text(name, process.name);
  text(pid, process.pid ? process.pid : "");
  text(note, process.note);
  note.title = process.note;
  const restarts = process.restarts ? ` ×${process.restarts}` : "";
  const label = broken && process.state === "running" ? "restarted" : LABELS[process.state] ?? process.state;
  text(row.cells[1].firstChild, label + restarts);
  text(row.cells[2], rate(process.received_per_s));
  text(row.cells[3], rate(process.sent_per_s));
  text(row.cells[4], `${(100 * process.cpu).toFixed(0)} %`);
}

function text(node, value) {
  if (node.textContent !== String(value)) node.textContent = value;
}

function rate(value) {
  return value >= 100 ? value.toFixed(0) : value.toFixed(1);
}

/** The inputs of the filter, as a text. */
export function filterText({ from_sonar: sonar, from_camera: camera }) {
  if (sonar === null) return "No filter is running: every echo enters the map.";
  const senses = [sonar && "sonar", camera && "camera"].filter(Boolean);
  return senses.length ? `The filter uses motion from ${senses.join(" and ")}.` : "The filter receives no motion: every echo enters the map.";
}
