// @ts-check
// The session's server: requests with the token, images as typed arrays, and the stream of events.

/** An answer that is not a success. */
export class Refusal extends Error {
    /** @param {number} status @param {string} message @param {any} body @param {string} etag */
    constructor(status, message, body = null, etag = '') {
        super(message);
        this.status = status;
        this.body = body;
        this.etag = etag;
    }
}

/**
 * @typedef {{run: number, passes: number, x: number, y: number, rectWidth: number, rectHeight: number, level: number,
 *            channels: number, scale: number, width: number, height: number, columns: number, rows: number,
 *            halves: Uint16Array}} Picture
 */

/** @param {ArrayBuffer} bytes @returns {Picture} */
export function decodePicture(bytes) {
    const v = new DataView(bytes);
    if (bytes.byteLength < 64 || v.getUint32(0, true) !== 0x444e5445) throw new Error('this is no image');
    if (v.getUint32(4, true) !== 1) throw new Error('the server speaks another version; reload the page');
    // The scale may be negative.
    const [run, passes, x, y, rectWidth, rectHeight, level, channels, scale, width, height, columns, rows] =
        Array.from({length: 13}, (_, i) => i === 8 ? v.getInt32(8 + 4 * i, true) : v.getUint32(8 + 4 * i, true));
    return {run, passes, x, y, rectWidth, rectHeight, level, channels, scale, width, height, columns, rows,
        halves: new Uint16Array(bytes, 64)};
}

export class Server {
    /** @param {string} token */
    constructor(token) { this.token = token; }

    /** @param {string} path @param {RequestInit} [options] */
    async fetch(path, options = {}) {
        const response = await fetch(path, {...options, headers: {...options.headers, Authorization: `Bearer ${this.token}`}});
        if (response.ok) return response;
        const body = await response.json().catch(() => null);
        throw new Refusal(response.status, body?.error ?? response.statusText, body, response.headers.get('ETag') ?? '');
    }

    /** @param {string} path */
    async get(path) { return (await this.fetch(path)).json(); }

    /** @param {string} path @param {object} body */
    async post(path, body) { return (await this.fetch(path, {method: 'POST', body: JSON.stringify(body)})).json(); }

    /**
     * @param {File} file @param {number} mostBytes The server would end the connection of a longer one before it is read.
     * @returns {Promise<number>} The id of the image that is opened.
     */
    async openImage(file, mostBytes) {
        if (file.size > mostBytes) throw new Error(`${file.name} is larger than ${mostBytes / 2 ** 20} MiB`);
        const response = await this.fetch(`/v1/images?file=${encodeURIComponent(file.name)}`, {method: 'POST', body: file});
        return (await response.json()).image;
    }

    /** @param {number} image */
    async removeImage(image) { await this.fetch(`/v1/images?image=${image}`, {method: 'DELETE'}); }

    /** @param {Record<string, string | number>} query @returns {Promise<Picture | null>} null: nothing newer. */
    async image(query) {
        const text = Object.entries(query).map(([k, v]) => `${k}=${encodeURIComponent(v)}`).join('&');
        const response = await this.fetch(`/v1/image?${text}`);
        return response.status === 204 ? null : decodePicture(await response.arrayBuffer());
    }

    /** @param {string} name @returns {Promise<{list: any[], etag: string}>} */
    async paths(name) {
        const response = await this.fetch(`/v1/paths?file=${encodeURIComponent(name)}`);
        return {list: await response.json(), etag: response.headers.get('ETag') ?? ''};
    }

    /** @param {string} name @param {any[]} list @param {string} etag @returns {Promise<string>} The new version. */
    async putPaths(name, list, etag) {
        const response = await this.fetch(`/v1/paths?file=${encodeURIComponent(name)}`,
            {method: 'PUT', body: JSON.stringify(list), headers: {'If-Match': etag}});
        return response.headers.get('ETag') ?? '';
    }

    /** Parts of the scene as triangles. */
    async geometry() {
        const bytes = await (await this.fetch('/v1/geometry')).arrayBuffer();
        const length = new DataView(bytes).getUint32(0, true);
        const shapes = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, length)));
        for (const s of shapes) {
            s.positions = new Uint16Array(bytes, 4 + length + s.positions_at, 3 * s.vertices);
            s.triangles = new Uint32Array(bytes, 4 + length + s.indices_at, s.indices);
            s.coarse = new Uint32Array(bytes, 4 + length + s.coarse_at, s.coarse_indices);
            s.matrices = new Float32Array(bytes, 4 + length + s.places_at, 12 * s.places);
        }
        return shapes;
    }

    /**
     * Calls `use` for every event, until the connection ends, which throws.
     * @param {(event: any) => void} use
     */
    async listen(use) {
        const response = await this.fetch('/v1/events');
        const reader = /** @type {ReadableStream<Uint8Array>} */ (response.body).getReader();
        const decoder = new TextDecoder();
        // The server sends a heartbeat every 5 s.
        const kSilence = 15000;
        for (let rest = ''; ;) {
            /** @type {ReturnType<typeof setTimeout> | undefined} */
            let timer;
            const silence = new Promise((_, reject) => { timer = setTimeout(() => reject(new Error('the server is silent')), kSilence); });
            const {done, value} = await Promise.race([reader.read(), silence]).finally(() => clearTimeout(timer));
            if (done) throw new Error('the server ended the connection');
            const lines = (rest + decoder.decode(value, {stream: true})).split('\n');
            rest = /** @type {string} */ (lines.pop());
            for (const line of lines) if (line) use(JSON.parse(line));
        }
    }
}
