// SPDX-License-Identifier: Apache-2.0
// The connection to the console's program; it comes back by itself.

const VERSION = 1;
const RETRY = 1000; // [ms]
const TOKEN = "token";

// The part after # never leaves the browser: the token is kept for this tab only.
function token() {
  const given = new URLSearchParams(location.hash.slice(1)).get(TOKEN);
  if (given) {
    sessionStorage.setItem(TOKEN, given);
    history.replaceState(null, "", location.pathname);
  }
  return sessionStorage.getItem(TOKEN) ?? "";
}

export class Link {
  constructor({ onText, onBytes, onState }) {
    Object.assign(this, { onText, onBytes, onState });
    this.token = token();
    this.connect();
  }

  connect() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/socket`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.socket = socket;
      this.send({ kind: "hello", version: VERSION, token: this.token });
    };
    socket.onmessage = ({ data }) => {
      if (typeof data === "string") this.onText(JSON.parse(data));
      else this.onBytes(data);
    };
    socket.onclose = ({ code, reason }) => {
      this.socket = null;
      this.onState(reason || (code === 1006 ? "not connected" : `closed (${code})`));
      setTimeout(() => this.connect(), RETRY);
    };
  }

  send(message) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }
}
