// The price of a live view: processor time of a number of passes of `etendue studio` without a page, over that with a page
// that fetches every picture at full size. Both run at the same time, each on its own core, and exchange the cores from pair
// to pair, so whatever else the machine does concerns both. Both render the same passes, and their time is read when
// nothing of these passes is left to do. Needs two cores; without other load, or at a high priority, the ratios of pairs
// differ by a few tenths of a percent.
//
//     node view-cost.mjs etendue scene.xml [pairs] [seconds of each] [width x height]

import {spawn} from 'node:child_process';
import {mkdtempSync, readFileSync, rmSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';

const [program, scene, pairs = '6', seconds = '20', resolution = '1920x1080'] = process.argv.slice(2);
if (!scene) {
    console.error('usage: view-cost.mjs etendue scene.xml [pairs] [seconds] [WxH]');
    process.exit(2);
}
const folder = mkdtempSync(join(tmpdir(), 'etendue-view-cost-'));
const sleep = ms => new Promise(r => setTimeout(r, ms));

/// A process of the studio, with one thread on one core.
class Studio {
    static async open(core) {
        const studio = new Studio();
        studio.child = spawn('taskset', ['-c', String(core), program, 'studio', scene, '--idle', '--resolution', resolution,
                                         '--threads', '1', '-o', folder, '--grace', '0'], {stdio: ['ignore', 'pipe', 'ignore']});
        studio.url = await new Promise(fulfil => studio.child.stdout.once('data', d => fulfil(new URL(d.toString().trim()))));
        while (!(await studio.state()).scene) await sleep(50);
        return studio;
    }
    fetch(path, options = {}) {
        return fetch(this.url.origin + path, {...options, headers: {Authorization: `Bearer ${this.url.hash.slice('#token='.length)}`}});
    }
    async state() { return (await this.fetch('/v1/state')).json(); }
    async start(limits) {
        const body = JSON.stringify({action: 'start', integrator: 'path', sampler: 'independent', ...limits});
        return (await (await this.fetch('/v1/run', {method: 'POST', body})).json()).run;
    }
    /// Processor time so far, in seconds.
    cpu() {
        const fields = readFileSync(`/proc/${this.child.pid}/stat`, 'utf8').split(') ')[1].split(' ');
        return (Number(fields[11]) + Number(fields[12])) / 100;
    }
    /// Renders the passes; returns their processor time in seconds, and the number of pictures that were fetched. The
    /// process then renders on, so that its core is not idle while another process is measured.
    async measure(passes, isViewed) {
        const before = this.cpu();
        const run = await this.start({spp: passes});
        let pictures = 0, shown = 0;
        while ((await this.state()).runs[0].state !== 'finished') {
            await sleep(100);
            if (!isViewed) continue;
            const image = await this.fetch(`/v1/image?run=${run}&view=image&after=${shown}`);
            if (image.status !== 200) continue;
            shown = new DataView(await image.arrayBuffer()).getUint32(12, true);
            ++pictures;
        }
        const after = this.cpu();
        await this.start({});
        return {seconds: after - before, pictures};
    }
    async close() {
        const ended = new Promise(r => this.child.on('exit', r));
        this.child.kill('SIGKILL');
        await ended;
    }
}

async function measurePair(passes, coreOfViewed) {
    const studios = await Promise.all([Studio.open(1 - coreOfViewed), Studio.open(coreOfViewed)]);
    try {
        return await Promise.all(studios.map((s, i) => s.measure(passes, i === 1)));
    } finally {
        await Promise.all(studios.map(s => s.close()));
    }
}

const passes = Math.max(1, Math.round(Number(seconds) / ((await measurePair(2, 0))[0].seconds / 2)));
const ratios = [];
for (let i = 0; i < Number(pairs); ++i) {
    const [without, viewed] = await measurePair(passes, i % 2);
    ratios.push(without.seconds / viewed.seconds);
    console.log(`${passes} passes: ${without.seconds.toFixed(2)} s without a view, ${viewed.seconds.toFixed(2)} s with ` +
                `${viewed.pictures} pictures: ratio ${ratios.at(-1).toFixed(4)}`);
}
const mean = ratios.reduce((a, b) => a + b, 0) / ratios.length;
const error = Math.sqrt(ratios.reduce((s, r) => s + (r - mean) ** 2, 0) / Math.max(1, ratios.length - 1) / ratios.length);
const sorted = ratios.slice().sort((a, b) => a - b);
const median = (sorted[(sorted.length - 1) >> 1] + sorted[sorted.length >> 1]) / 2;
console.log(`ratio: median ${median.toFixed(4)}, mean ${mean.toFixed(4)} ± ${error.toFixed(4)}`);
rmSync(folder, {recursive: true, force: true});
