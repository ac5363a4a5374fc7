// SPDX-License-Identifier: Apache-2.0
// Side panel: authority, law and gains, simulation, diagnostics.

const SOURCES = ["human", "autonomy", "hold"];
const GAINS = ["stiffness", "damping"];

const find = (id) => document.getElementById(id);

function element(kind, text = "", className = "") {
  const created = document.createElement(kind);
  created.textContent = text;
  created.className = className;
  return created;
}

export class Panel {
  constructor(send) {
    this.send = send;
    this.controls = []; // Enabled for the driver only.
    for (const kind of ["step", "reset", "refill"]) {
      find(kind).onclick = () => send({ kind });
      this.controls.push(find(kind));
    }
    find("pause").onclick = () => send({ kind: "pause", on: !this.paused });
    find("law").onchange = ({ target }) => send({ kind: "law", law: target.value });
    this.fixed = [...this.controls, find("pause"), find("law")];
  }

  build({ subtasks, laws }) {
    find("law").replaceChildren(...laws.map((law) => new Option(law, law)));
    find("subtasks").replaceChildren();
    find("gains").replaceChildren();
    this.rows = new Map();
    this.controls = [...this.fixed];
    for (const { name } of subtasks) {
      this.rows.set(name, { ...this.buildAuthority(name), gains: this.buildGains(name) });
    }
  }

  buildAuthority(name) {
    const row = element("div", "", "subtask");
    const title = element("b", name);
    const silent = element("em");
    const choices = element("div", "", "choices");
    const buttons = SOURCES.map((source) => {
      const button = element("button", source);
      button.type = "button";
      button.dataset.subtask = name;
      button.dataset.source = source;
      button.onclick = () => this.send({ kind: "authority", subtask: name, source });
      choices.append(button);
      return button;
    });
    this.controls.push(...buttons);
    title.append(" ", silent);
    row.append(title, choices);
    find("subtasks").append(row);
    return { buttons, silent };
  }

  buildGains(name) {
    find("gains").append(element("h3", name));
    return GAINS.map((gain) => {
      const row = element("div", "", "gain");
      const input = element("input");
      input.inputMode = "decimal";
      input.setAttribute("aria-label", `${gain} of ${name}`);
      input.dataset.gain = `${name}.${gain}`;
      const button = element("button", "Set");
      button.type = "button";
      const apply = () => {
        const values = input.value.split(",").map((item) => (item.trim() ? Number(item) : NaN));
        input.classList.remove("edited");
        // Reject them here, because JSON has no NaN. All other checks are the controller's.
        if (values.every(Number.isFinite)) {
          this.send({ kind: "gains", subtask: name, name: gain, values });
        } else {
          this.notify(false, `${gain} of ${name}: enter numbers separated by commas`);
        }
      };
      input.oninput = () => input.classList.add("edited");
      input.onkeydown = ({ key }) => key === "Enter" && apply();
      button.onclick = apply;
      this.controls.push(input, button);
      row.append(element("span", gain), input, button);
      find("gains").append(row);
      return { gain, input };
    });
  }

  update(status, drives) {
    this.paused = status.paused;
    find("pause").textContent = status.paused ? "Continue" : "Pause";
    find("pause").setAttribute("aria-pressed", String(status.paused));
    find("refill").hidden = !status.refill;
    if (status.law && document.activeElement !== find("law")) find("law").value = status.law;
    for (const [name, subtask] of Object.entries(status.subtasks)) {
      const row = this.rows.get(name);
      if (!row) continue;
      row.silent.textContent = subtask.silent ? `${subtask.authority} silent: holding` : "";
      for (const button of row.buttons) {
        button.setAttribute("aria-pressed", String(button.dataset.source === subtask.authority));
      }
      for (const { gain, input } of row.gains) {
        const editing = document.activeElement === input || input.classList.contains("edited");
        if (!editing && subtask[gain]) input.value = subtask[gain].join(", ");
      }
    }
    for (const button of this.controls) button.disabled = !drives;
    find("step").disabled = !drives || !status.paused;
    find("programs").replaceChildren(
      ...status.programs.map(({ name, level, text }) => {
        const line = element("li", `${name}: ${text}`);
        line.dataset.level = level;
        return line;
      }),
    );
  }

  notify(ok, text) {
    const line = element("p", text, ok ? "" : "bad");
    find("responses").append(line);
    while (find("responses").children.length > 3) find("responses").firstChild.remove();
    setTimeout(() => line.remove(), ok ? 3000 : 7000);
  }
}
