// Images of files in `etendue studio` in a headless browser: files of other formats and folders are opened beside a run, compared
// with it, tone-mapped and removed; what is not an image or has another size is refused by name.
//
//     node check_images.mjs etendue scene.xml [folder for screenshots]

import {spawnSync} from 'node:child_process';
import {mkdirSync, truncateSync, writeFileSync} from 'node:fs';
import {join} from 'node:path';

import {Studio, check, checkNames, differs, folder, openBrowser, pixels, program, runParts, sceneFile} from './page.mjs';

const size = ['--resolution', '64x48'], elsewhere = join(folder, 'elsewhere');
function run(...args) {
    const {status, stderr} = spawnSync(program, args);
    if (status !== 0) throw new Error(`${args.join(' ')}: ${stderr}`);
}
mkdirSync(elsewhere);
const file = name => join(elsewhere, name);
const render = (...more) => run('render', sceneFile, '-i', 'bdpt', '--spp', '4', '--threads', '1', ...more);
render(...size, '-o', file('image.exr'), '--checkpoint', file('kept.etd'));
render(...size, '-o', file('image.hdr'));
run('tonemap', file('image.exr'), file('picture.png'), '--operator', 'srgb');
render('--resolution', '32x24', '-o', file('small.exr'));
writeFileSync(file('text.exr'), 'no image');
writeFileSync(file('long.exr'), '');
truncateSync(file('long.exr'), 2 ** 29 + 1);

const choose = (id, value) => `(() => { const s = document.getElementById('${id}'); s.value = '${value}'; s.dispatchEvent(new Event('change')); })()`;
const banner = "document.getElementById('banner-text').textContent";
const label = "document.getElementById('label').textContent";
const press = name => `document.querySelector('[aria-label="${name}"]').click()`;

async function open(browser, ...names) {
    const {root} = await browser.send('DOM.getDocument');
    const {nodeId} = await browser.send('DOM.querySelector', {nodeId: root.nodeId, selector: '#image-files'});
    await browser.send('DOM.setFileInputFiles', {nodeId, files: names.map(file)});
}

/// Measures the two places, and returns relMSE and FLIP.
async function measured(browser) {
    await browser.evaluate("[...document.querySelectorAll('#view-tools button')].find(b => b.textContent === 'Measure').click()");
    const output = "document.querySelector('#view-tools > output').textContent";
    await browser.until(`${output}.includes('relMSE')`, 'the difference');
    const found = await browser.evaluate(output);
    return {text: found, relMse: Number(found.match(/relMSE ([^,]+)/)[1]), flip: Number(found.match(/FLIP ([^:]+)/)[1])};
}

async function imagesPart(browser) {
    await browser.until('studio.state()?.scene', 'the scene');
    await browser.evaluate("studio.server.post('/v1/run', {action: 'start', integrator: 'bdpt', spp: 4})");
    await browser.until("studio.runs.get(1)?.state === 'finished' && studio.shown[0].passes === 4", 'the same rendering');

    await open(browser, 'image.exr', 'image.hdr', 'picture.png', 'kept.etd');
    await browser.until("document.querySelectorAll('#image-list .run').length === 4", 'four files');
    await browser.until(`${label} === 'kept.etd' && studio.shown[0].passes > 0`, 'the last one is shown');
    await browser.until("document.getElementById('pixel').textContent.match(/kept.etd, bdpt.*, 4 spp/)", 'its values');
    const rows = await browser.evaluate("[...document.querySelectorAll('#image-list .figures')].map(e => e.textContent)");
    check(/^64 × 48, bdpt.*, 4 spp$/.test(rows[0]) && rows[1] === '64 × 48' && /^64 × 48, bdpt.*, 4 spp$/.test(rows[3]), `the list says what they are: ${rows}`);
    check(await browser.evaluate("document.getElementById('pixel').textContent.includes('±')"), 'a kept run has intervals');
    check(await browser.evaluate("document.getElementById('histogram-text').textContent.includes('95 % below')"), 'the histogram is that of the file');
    await checkNames(browser, 'opened images');
    await browser.settle();
    const plain = await pixels(browser, 'view');
    check(new Set(plain).size > 20, 'it is drawn');
    await browser.evaluate(choose('tone', 1));
    await browser.settle();
    check(differs(plain, await pixels(browser, 'view')), 'its tones are mapped');
    await browser.evaluate(choose('tone', 0));

    // Against the run with the same bits.
    await browser.evaluate(choose('against', 1));
    await browser.until('studio.view.pictures[1]', 'the run beside it');
    const kept = await measured(browser);
    check(kept.relMse === 0 && kept.flip === 0 && kept.text.includes('kept.etd, against run 1, 4 spp'), `a kept run has the bits of the run: ${kept.text}`);
    await browser.screenshot('images-1-kept');
    await browser.evaluate(press('Show run 1'));
    await browser.until("studio.shown[0].run === 1 && studio.shown[0].view === 'image' && studio.shown[0].passes === 4", 'the run is shown');
    for (const [name, id, least, most] of [['image.exr', 1, 0, 0], ['image.hdr', 2, 1e-4, 0.02], ['picture.png', 3, 1e-4, 0.05]]) {
        await browser.evaluate(choose('against', `opened:${id}`));
        await browser.until(`${label}.endsWith('| ${name}')`, name);
        await browser.until(`document.getElementById('pixel').textContent.includes('${name}')`, 'values of both');
        const m = await measured(browser);
        check(m.flip >= least && m.flip <= most && m.text.includes(`against ${name}`), m.text);
    }
    await browser.evaluate(choose('mode', 2));
    await browser.settle();
    check(new Set(await pixels(browser, 'view')).size > 3, 'the difference to a file is drawn');
    await browser.screenshot('images-2-difference');
    await browser.evaluate(choose('mode', 0));

    // What cannot be shown.
    await open(browser, 'text.exr');
    await browser.until(`${banner}.includes('text.exr')`, 'a file that is no image is named');
    await open(browser, 'long.exr');
    await browser.until(`${banner} === 'long.exr is larger than 512 MiB'`, 'a file that is too long is named');
    // Dropped beside the image; and a file that is no image before one that is.
    await browser.evaluate(`(() => {
        const dropped = new DataTransfer();
        dropped.items.add(new File(['no image'], 'dropped.exr'));
        window.isKept = ['dragover', 'drop'].map(type => {
            const event = new DragEvent(type, {bubbles: true, cancelable: true, dataTransfer: dropped});
            document.body.dispatchEvent(event);
            return event.defaultPrevented;
        });
    })()`);
    check(await browser.evaluate('window.isKept.every(k => k)'), 'the page stays when a file is dropped beside the image');
    await browser.until(`${banner}.includes('dropped.exr')`, 'a file that is dropped is opened');
    await open(browser, 'text.exr', 'small.exr');
    await browser.until(`${banner}.includes('text.exr')`, 'a file that is no image is named');
    await browser.until("document.querySelectorAll('#image-list .run').length === 5", 'the next one is opened');
    check(await browser.evaluate("/^32 × 24, other size/.test(document.querySelector('#image-list .run:last-child .figures').textContent)"), 'another size is marked');
    await browser.evaluate(press('Show small.exr'));
    await browser.until(`${banner}.includes('small.exr has 32 × 24 pixels')`, 'a file of another size is named');

    // Removed while it is shown on both sides.
    await browser.evaluate(press('Show picture.png'));
    await browser.until(`${label}.startsWith('left | right: picture.png')`, 'one file');
    await browser.until("document.getElementById('pixel').textContent.split('picture.png').length === 3", 'its values, twice');
    await browser.evaluate(press('Remove picture.png'));
    await browser.until("studio.shown[0].run === 1 && !studio.shown[1] && document.querySelectorAll('#image-list .run').length === 4", 'the run takes its place');
    check(await browser.evaluate("![...document.getElementById('against').options].some(o => o.value === 'opened:3')"), 'it is no longer offered');
}

await runParts(async () => {
    const studio = await Studio.start(sceneFile, ...size, '--idle');
    const browser = openBrowser();
    try {
        await browser.open(studio.url);
        await imagesPart(browser);
        const complaints = browser.complaints.filter(c => !c.includes('409') && !c.includes('422'));
        check(complaints.length === 0, `the console is quiet: ${complaints.join('; ')}`);
    } finally {
        browser.close();
        await studio.stop();
    }
});
