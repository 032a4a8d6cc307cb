// The histogram of a picture, without a browser: its largest value is that of all pixels, and its sample has all columns.
//
//     node check_histogram.mjs

import {readFileSync} from 'node:fs';

const text = readFileSync(new URL('../../src/studio/page/histogram.js', import.meta.url), 'utf8');
const {fromHalf, histogramOf} = await import(`data:text/javascript,${encodeURIComponent(text)}`);

let failures = 0;
function check(holds, what) {
    console.log(`${holds ? 'ok  ' : 'FAIL'} ${what}`);
    if (!holds) ++failures;
}

const kOne = 0x3c00, kEight = 0x4800, kThousand = 0x63d0, kInfinity = 0x7c00, kNan = 0x7e00;
check([kOne, kEight, kThousand].map(fromHalf).join() === '1,8,1000', 'half floats have their values');

/** A picture of `size`² pixels. */
function picture(size, channels, value) {
    const halves = new Uint16Array(size * size * channels);
    for (let i = 0; i < size * size; ++i) halves.fill(value(i % size, Math.floor(i / size)), channels * i, channels * (i + 1));
    return {channels, columns: size, rows: size, scale: 1, halves};
}

// Every fourth column is bright, and one pixel that a sample may miss is the brightest.
for (const [size, channels] of [[512, 3], [512, 1], [1024, 1], [40, 3]]) {
    const h = histogramOf(picture(size, channels, (x, y) => x === 3 && y === 7 ? kThousand : x === 2 && y === 0 ? kInfinity : x === 6 && y === 1 ? kNan : x % 4 === 1 ? kEight : kOne));
    const what = `${size} × ${size} pixels, ${channels} channels`;
    check(Math.abs(h.largest - 2000) < 1e-3, `${what}: the largest value is ${h.largest}`);
    check(Math.abs(h.percentile - 16) < 1e-3, `${what}: 95 % are below ${h.percentile}`);
    check(Math.abs(h.bins.reduce((a, b) => a + b) + h.dark + h.bad - 1) < 1e-9, `${what}: the bins add up`);
}
const negative = histogramOf(picture(16, 1, () => kOne | 0x8000));
check(negative.largest === -2 && negative.dark === 1, 'values below 0 are no light');
const bad = histogramOf(picture(16, 3, () => kNan));
check(bad.largest === 0 && bad.bad === 1, 'nothing but NaN has no largest value');
process.exitCode = failures > 0 ? 1 : 0;
