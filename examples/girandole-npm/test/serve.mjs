// Serves a folder to this machine and prints the port: node serve.mjs FOLDER [PORT]. Without a port, any free one.
import { createReadStream } from "node:fs";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";

const TYPES = { ".html": "text/html", ".js": "text/javascript", ".wasm": "application/wasm", ".wgsl": "text/plain" };
const [folder, port] = process.argv.slice(2);

const server = createServer((request, response) => {
    const { pathname } = new URL(request.url, "http://localhost");
    const path = join(folder, normalize(pathname.endsWith("/") ? `${pathname}index.html` : pathname));
    const file = createReadStream(path);
    file.once("open", () => {
        response.writeHead(200, { "content-type": TYPES[extname(path)] ?? "application/octet-stream" });
        file.pipe(response);
    });
    file.once("error", () => response.writeHead(404).end());
});
server.listen(Number(port ?? 0), "127.0.0.1", () => console.log(server.address().port));
