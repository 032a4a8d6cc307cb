#include "session/snapshot.h"

#include <cmath>

#include "film/parallel_chunks.h"
#include "math/statistics.h"

namespace etendue {

double interval_half_width(double variance, uint64_t passes) {
    return student_quantile(0.05, double(passes - 1)) * std::sqrt(variance);
}

std::shared_ptr<Snapshot> SnapshotPool::take() {
    std::unique_ptr<Snapshot> snapshot;
    {
        const std::lock_guard lock(shelf_->mutex);
        if (!shelf_->free.empty()) {
            snapshot = std::move(shelf_->free.back());
            shelf_->free.pop_back();
        }
    }
    if (!snapshot) snapshot = std::make_unique<Snapshot>();
    return {snapshot.release(), [shelf = shelf_](Snapshot* s) {
                std::unique_ptr<Snapshot> owned(s);
                const std::lock_guard lock(shelf->mutex);
                if (shelf->free.size() < 2) shelf->free.push_back(std::move(owned));
            }};
}

void fill_snapshot(const Film& film, bool has_groups, Snapshot& to) {
    to.passes = film.passes();
    to.width = film.geometry().crop_width, to.height = film.geometry().crop_height;
    const std::span<const Film::Moments> moments = film.moments();
    const double n = double(film.passes()), inv = n > 0 ? 1 / n : 0;
    to.mean.resize(moments.size());
    if (has_groups)
        to.variance = film.variance();
    else
        to.variance.resize(moments.size());
    const double inv_variance = n > 1 ? 1 / (n - 1) : 0;
    for_film_chunks(moments.size(), [&](uint64_t, uint64_t begin, uint64_t end) {
        for (uint64_t i = begin; i < end; ++i) {
            const Film::Moments& m = moments[i];
            for (int c = 0; c < 3; ++c) {
                const double mean = m.sum[c] * inv;
                to.mean[i][c] = float(mean);
                if (has_groups) continue;
                to.variance[i][c] =
                    float(std::max(0.0, m.square[c] * inv - mean * mean) * inv_variance);
            }
        }
    });
}

}  // namespace etendue
