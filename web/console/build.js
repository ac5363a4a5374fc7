// SPDX-License-Identifier: Apache-2.0
// Build the page into the given folder, by default the package's static folder.

import { build } from "esbuild";
import { copyFile, mkdir, readFile, writeFile } from "node:fs/promises";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const out = process.argv[2] ?? join(here, "../../noninteract_ros/console/static");

await mkdir(out, { recursive: true });
await build({
  absWorkingDir: here,
  entryPoints: ["source/main.js"],
  outfile: join(out, "main.js"),
  bundle: true,
  minify: true,
  format: "esm",
  target: "es2022",
  charset: "utf8",
  legalComments: "none", // LICENSES.txt contains the full texts.
  banner: { js: "/* SPDX-License-Identifier: Apache-2.0 AND MIT; see LICENSES.txt */" },
});
for (const name of ["index.html", "style.css"]) {
  await copyFile(join(here, "source", name), join(out, name));
}
const three = JSON.parse(await readFile(join(here, "node_modules/three/package.json"), "utf8"));
const licence = await readFile(join(here, "node_modules/three/LICENSE"), "utf8");
await writeFile(
  join(out, "LICENSES.txt"),
  "main.js is built from web/console of noninteract_ros (Apache-2.0, see its LICENSE) and from\n" +
    `three.js ${three.version}, whose licence follows.\n\n${licence}`,
);
