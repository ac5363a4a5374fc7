// SPDX-License-Identifier: Apache-2.0
// Who leads what, law and gains, simulation, diagnostics.

const SOURCES = ["human", "autonomy", "hold"];
const GAINS = ["stiffness", "damping"];

const find = (id) => document.getElementById(id);

function element(kind, text = "", className = "") {
  const made = document.createElement(kind);
  made.textContent = text;
  made.className = className;
  return made;
}

export class Panel {
  constructor(send) {
    this.send = send;
    this.buttons = []; // Those that only a driver may press.
    for (const kind of ["step", "reset", "refill"]) {
      find(kind).onclick = () => send({ kind });
      this.buttons.push(find(kind));
    }
    find("pause").onclick = () => send({ kind: "pause", on: !this.paused });
    find("law").onchange = ({ target }) => send({ kind: "law", law: target.value });
    this.fixed = [...this.buttons, find("pause"), find("law")];
  }

  build({ subtasks, laws }) {
    find("law").replaceChildren(...laws.map((law) => new Option(law, law)));
    find("subtasks").replaceChildren();
    find("gains").replaceChildren();
    this.rows = new Map();
    this.buttons = [...this.fixed];
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
    this.buttons.push(...buttons);
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
        const values = input.value.split(",").map((word) => (word.trim() ? Number(word) : NaN));
        input.classList.remove("edited");
        // Numbers that are none are refused by the program, which says so; NaN has no JSON.
        if (values.every(Number.isFinite)) {
          this.send({ kind: "gains", subtask: name, name: gain, values });
        } else {
          this.say(false, `${gain} of ${name}: numbers with commas between them, please`);
        }
      };
      input.oninput = () => input.classList.add("edited");
      input.onkeydown = ({ key }) => key === "Enter" && apply();
      button.onclick = apply;
      this.buttons.push(input, button);
      row.append(element("span", gain), input, button);
      find("gains").append(row);
      return { gain, input };
    });
  }

  take(status, drives) {
    this.paused = status.paused;
    find("pause").textContent = status.paused ? "Go on" : "Pause";
    find("pause").setAttribute("aria-pressed", String(status.paused));
    find("refill").hidden = !status.refill;
    if (status.law && document.activeElement !== find("law")) find("law").value = status.law;
    for (const [name, told] of Object.entries(status.subtasks)) {
      const row = this.rows.get(name);
      if (!row) continue;
      row.silent.textContent = told.silent ? `${told.authority} silent: holding` : "";
      for (const button of row.buttons) {
        button.setAttribute("aria-pressed", String(button.dataset.source === told.authority));
      }
      for (const { gain, input } of row.gains) {
        const busy = document.activeElement === input || input.classList.contains("edited");
        if (!busy && told[gain]) input.value = told[gain].join(", ");
      }
    }
    for (const button of this.buttons) button.disabled = !drives;
    find("step").disabled = !drives || !status.paused;
    find("programs").replaceChildren(
      ...status.programs.map(({ name, level, text }) => {
        const line = element("li", `${name}: ${text}`);
        line.dataset.level = level;
        return line;
      }),
    );
  }

  say(ok, text) {
    const line = element("p", text, ok ? "" : "bad");
    find("answers").append(line);
    while (find("answers").children.length > 3) find("answers").firstChild.remove();
    setTimeout(() => line.remove(), ok ? 3000 : 7000);
  }
}
