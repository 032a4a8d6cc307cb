#include "reuse/irradiance_cache.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "math/frame.h"

namespace etendue {

IrradianceRecord measure_irradiance(Vec3 p, Vec3 n, int rays, Sampler& sampler,
                                    const std::function<IncidentRadiance(Vec3)>& radiance) {
    // M × N cells of equal cosine-weighted solid angle; N ≈ π M makes width and height of cells similar.
    const int M = std::max(1, int(std::lround(std::sqrt(float(rays) * kInvPi))));
    const int N = std::max(3, int(std::lround(float(rays) / float(M))));
    const Frame frame = Frame::from_normal(n);
    const auto azimuth = [&](float k) {
        const float phi = 2 * kPi * k / float(N);
        return frame.s * std::cos(phi) + frame.t * std::sin(phi);
    };
    const auto sin_boundary = [&](int j) { return std::sqrt(float(j) / float(M)); };

    IrradianceRecord out{.p = p, .n = n, .E = {}, .rotation = {}, .translation = {}, .distance = 0};
    const auto add = [](std::array<Vec3, 3>& gradient, Vec3 along, Rgb value) {
        for (int c = 0; c < 3; ++c) gradient[size_t(c)] += along * value[c];
    };

    std::vector<IncidentRadiance> cells(size_t(M) * size_t(N));  // row j from the pole, column k
    double inverse_distances = 0;
    for (int k = 0; k < N; ++k)
        for (int j = 0; j < M; ++j) {
            const Vec2 u = sampler.next_2d();
            // Rounding must not move the last row to the horizon, where tan θ is infinite.
            const float sin2 = std::min((float(j) + u.x) / float(M), kOneMinusEpsilon),
                        sine = std::sqrt(sin2), cosine = safe_sqrt(1 - sin2), at = float(k) + u.y;
            const IncidentRadiance cell = radiance(azimuth(at) * sine + n * cosine);
            cells[size_t(k * M + j)] = cell;
            out.E += cell.L;
            inverse_distances += 1 / double(cell.distance);
            // tan θ L times v̂, which is a quarter turn ahead [Ward & Heckbert 1992, eq. 2]: tilting n toward the light
            // increases E.
            add(out.rotation, azimuth(at + float(N) / 4), cell.L * (sine / cosine));
        }
    const float per_cell = kPi / float(M * N);
    out.E *= per_cell;
    for (Vec3& g : out.rotation) g *= per_cell;
    out.distance = float(double(M * N) / inverse_distances);

    // The border between two cells moves with the nearer surface [Ward & Heckbert 1992, eq. 3].
    for (int k = 0; k < N; ++k)
        for (int j = 0; j < M; ++j) {
            const IncidentRadiance& cell = cells[size_t(k * M + j)];
            const auto add_border = [&](const IncidentRadiance& other, Vec3 along, float factor) {
                // The distance may be 0.
                const float nearer = std::max(std::min(cell.distance, other.distance),
                                              std::numeric_limits<float>::min());
                add(out.translation, along, (cell.L - other.L) * (factor / nearer));
            };
            const float low = sin_boundary(j), high = sin_boundary(j + 1);
            if (j > 0)
                add_border(cells[size_t(k * M + j - 1)], azimuth(float(k) + 0.5f),
                           2 * kPi / float(N) * low * (1 - low * low));
            const int left = (k + N - 1) % N;
            add_border(cells[size_t(left * M + j)], azimuth(float(k) + float(N) / 4), high - low);
        }
    return out;
}

void IrradianceCache::reset(float error, float min_distance, float max_distance) {
    error_ = error;
    min_distance_ = min_distance;
    max_distance_ = max_distance;
    records_.clear();
    grid_ = {};
}

void IrradianceCache::add(std::span<const IrradianceRecord> records) {
    for (IrradianceRecord r : records) {
        // Limits the distance to that at which the gradient makes the irradiance 0 [Ward & Heckbert 1992].
        for (int c = 0; c < 3; ++c) {
            const float slope = length(r.translation[size_t(c)]);
            if (slope * r.distance > r.E[c]) r.distance = r.E[c] / slope;
        }
        r.distance = clamp(r.distance, min_distance_, max_distance_);
        records_.push_back(r);
    }
    std::vector<PointGrid::Entry> entries;
    for (uint32_t i = 0; i < records_.size(); ++i) entries.push_back({records_[i].p, i});
    grid_.build(entries, error_ * max_distance_);
}

std::optional<Rgb> IrradianceCache::find(Vec3 p, Vec3 n) const {
    Rgb sum;
    float weights = 0;
    grid_.for_each_near(p, error_ * max_distance_, [&](const PointGrid::Entry& e) {
        const IrradianceRecord& r = records_[e.index];
        const Vec3 d = p - r.p;
        const float change = length(d) / r.distance + safe_sqrt(1 - dot(n, r.n));
        if (!(change < error_)) return;
        // Points in front of the record's point may see light that is hidden from it.
        if (dot(d, n + r.n) < -0.02f * r.distance) return;
        const float w = 1 / std::max(change, 1e-4f);
        const Vec3 turn = cross(r.n, n);
        for (int c = 0; c < 3; ++c)
            sum[c] +=
                w * (r.E[c] + dot(turn, r.rotation[size_t(c)]) + dot(d, r.translation[size_t(c)]));
        weights += w;
    });
    if (!(weights > 0)) return {};
    Rgb E = sum * (1 / weights);
    for (int c = 0; c < 3; ++c) E[c] = std::max(E[c], 0.0f);
    return E;
}

}  // namespace etendue
