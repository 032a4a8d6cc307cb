// The price of a live view: rays for each second of processor time of `etendue studio` with a page that fetches every picture
// at full size, over that without a page; in pairs, in turns.
//
//     node view-cost.mjs etendue scene.xml [pairs] [seconds of each] [width x height]

import {spawn} from 'node:child_process';
import {mkdtempSync, readFileSync, rmSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';

const [program, scene, pairs = '5', seconds = '20', resolution = '1920x1080'] = process.argv.slice(2);
if (!scene) {
    console.error('usage: view-cost.mjs etendue scene.xml [pairs] [seconds] [WxH]');
    process.exit(2);
}
const folder = mkdtempSync(join(tmpdir(), 'etendue-view-cost-'));
const sleep = ms => new Promise(r => setTimeout(r, ms));

async function measure(isViewed) {
    const child = spawn(program, ['studio', scene, '-i', 'path', '--sampler', 'independent', '--resolution', resolution, '--threads', '1', '-o', folder, '--grace', '0']);
    const url = await new Promise(fulfil => child.stdout.once('data', d => fulfil(new URL(d.toString().trim()))));
    const headers = {Authorization: `Bearer ${url.hash.slice('#token='.length)}`};
    const get = path => fetch(url.origin + path, {headers});
    const run = async () => (await (await get('/v1/state')).json()).runs[0];
    while (!(await run())?.passes) await sleep(50);
    const cpu = () => {
        const fields = readFileSync(`/proc/${child.pid}/stat`, 'utf8').split(') ')[1].split(' ');
        return (Number(fields[11]) + Number(fields[12])) / 100;
    };
    const rays = async () => { const r = await run(); return r.rays * r.seconds; };
    const before = [await rays(), cpu()];
    let pictures = 0;
    for (const end = Date.now() + 1000 * Number(seconds), shown = {passes: 0}; Date.now() < end;) {
        await sleep(100);
        if (!isViewed) continue;
        const image = await get(`/v1/image?run=1&view=image&after=${shown.passes}`);
        if (image.status !== 200) continue;
        shown.passes = new DataView(await image.arrayBuffer()).getUint32(12, true);
        ++pictures;
    }
    const after = [await rays(), cpu()];
    const ended = new Promise(r => child.on('exit', r));
    child.kill('SIGKILL');
    await ended;
    return {rate: (after[0] - before[0]) / (after[1] - before[1]), pictures};
}

const ratios = [];
for (let i = 0; i < Number(pairs); ++i) {
    const [a, b] = i % 2 === 0 ? [await measure(false), await measure(true)] : (await measure(true).then(async v => [await measure(false), v]));
    ratios.push(b.rate / a.rate);
    console.log(`${(b.rate / 1e6).toFixed(3)} of ${(a.rate / 1e6).toFixed(3)} Mrays for a second of processor time, ${b.pictures} pictures: ratio ${ratios.at(-1).toFixed(4)}`);
}
const mean = ratios.reduce((a, b) => a + b, 0) / ratios.length;
const spread = Math.sqrt(ratios.reduce((s, r) => s + (r - mean) ** 2, 0) / Math.max(1, ratios.length - 1) / ratios.length);
console.log(`ratio ${mean.toFixed(4)} ± ${spread.toFixed(4)}`);
rmSync(folder, {recursive: true, force: true});
