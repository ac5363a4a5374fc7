// SPDX-License-Identifier: Apache-2.0
// WebSocket connection to operator_console with automatic reconnection.

const VERSION = 2;
const RETRY_PERIOD = 1000; // [ms]
const TOKEN = "token";

// Browsers do not send the part after #. The token is stored for this tab only.
function readToken() {
  const token = new URLSearchParams(location.hash.slice(1)).get(TOKEN);
  if (token) {
    sessionStorage.setItem(TOKEN, token);
    history.replaceState(null, "", location.pathname);
  }
  return sessionStorage.getItem(TOKEN) ?? "";
}

export class Connection {
  constructor({ onText, onBytes, onClose }) {
    Object.assign(this, { onText, onBytes, onClose });
    this.token = readToken();
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
      this.onClose(reason || (code === 1006 ? "not connected" : `closed (${code})`));
      setTimeout(() => this.connect(), RETRY_PERIOD);
    };
  }

  send(message) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }
}
