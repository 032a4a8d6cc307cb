#include "math/distribution.h"

#include <algorithm>

namespace etendue {
namespace {

constexpr double kBelowOne = 0x1.fffffffffffffp-1;

}  // namespace

AliasTable::AliasTable(std::span<const double> weights) {
    for (double w : weights) total_ += w;
    if (!(total_ > 0)) return;
    const size_t n = weights.size();
    cells_.resize(n);
    std::vector<double> scaled(n);
    std::vector<uint32_t> small, large;
    for (size_t i = 0; i < n; ++i) {
        cells_[i].pmf = float(weights[i] / total_);
        scaled[i] = weights[i] / total_ * double(n);
        (scaled[i] < 1 ? small : large).push_back(uint32_t(i));
    }
    while (!small.empty() && !large.empty()) {
        const uint32_t s = small.back(), l = large.back();
        small.pop_back();
        cells_[s].keep = scaled[s];
        cells_[s].alias = l;
        scaled[l] -= 1 - scaled[s];
        if (scaled[l] < 1) {
            large.pop_back();
            small.push_back(l);
        }
    }
    for (uint32_t i : large) cells_[i].keep = 1, cells_[i].alias = i;
    // Cells left over by rounding keep their own index, unless its weight is zero.
    for (uint32_t i : small) {
        cells_[i].keep = 1, cells_[i].alias = i;
        if (cells_[i].pmf == 0) {
            cells_[i].keep = 0;
            cells_[i].alias =
                uint32_t(std::max_element(weights.begin(), weights.end()) - weights.begin());
        }
    }
}

AliasTable::Draw AliasTable::sample(double u) const {
    const double scaled = u * double(cells_.size());
    const uint32_t i = std::min(uint32_t(scaled), uint32_t(cells_.size() - 1));
    const double f = std::min(scaled - i, kBelowOne);
    const Cell& c = cells_[i];
    if (f < c.keep) return {i, c.pmf, std::min(f / c.keep, kBelowOne)};
    return {c.alias, cells_[c.alias].pmf, std::min((f - c.keep) / (1 - c.keep), kBelowOne)};
}

namespace {

/// The cell of [0, 1) cut in n that x lies in.
int cell_of(float x, int n) {
    return std::clamp(int(x * float(n)), 0, n - 1);
}

/// The point (i + f) / n, corrected where rounding would move it into a neighbouring cell, whose density differs.
float point_in_cell(int i, float f, int n) {
    float x = (float(i) + f) / float(n);
    while (cell_of(x, n) > i) x = std::nextafter(x, 0.0f);
    while (cell_of(x, n) < i) x = std::nextafter(x, 1.0f);
    return std::min(x, kOneMinusEpsilon);
}

double sum_of(std::span<const float> values) {
    double sum = 0;
    for (const float v : values) sum += double(v);
    return sum;
}

}  // namespace

PiecewiseConstant1D::Steps::Steps(int cells, size_t rows)
    : cells(cells), guides((cells + kCellsPerGuide - 1) / kCellsPerGuide) {
    lower.reserve(rows * size_t(cells));
    guide.reserve(rows * size_t(guides));
}

void PiecewiseConstant1D::Steps::add(std::span<const float> values, double sum) {
    const size_t first = lower.size();
    // Whether a cell has a probability above zero; where no value is, all have the same.
    const auto counts = [&](int i) { return sum > 0 ? values[size_t(i)] > 0 : true; };
    uint32_t left = 0;
    for (int i = 0; i < cells; ++i) left += counts(i);
    double before = 0;
    uint32_t edge = 0;
    for (int i = 0; i < cells; ++i) {
        lower.push_back(edge);
        if (!counts(i)) continue;
        before += sum > 0 ? double(values[size_t(i)]) / sum : 1.0 / cells;
        // At least one step for this cell and for each of those that follow.
        --left;
        const auto rounded = uint32_t(std::min(before, 1.0) * kOne + 0.5);
        edge = left > 0 ? std::clamp(rounded, edge + 1, kOne - left) : kOne;
    }
    const uint32_t* row = &lower[first];
    int cell = 0;
    for (int g = 0; g < guides; ++g) {
        const auto at = uint32_t(uint64_t(kOne) * uint64_t(g) / uint64_t(guides));
        while (upper(row, cell) <= at) ++cell;
        Guide& made = guide.emplace_back(Guide{uint32_t(cell), {}});
        for (int k = 0; k <= kCellsInGuide; ++k)
            made.edge[k] = cell + k < cells ? row[cell + k] : kOne;
    }
}

PiecewiseConstant1D::Steps::Found PiecewiseConstant1D::Steps::find(double u, size_t r) const {
    const uint32_t at = uint32_t(u * kOne);
    const Guide& start = guide_of(u, r);
    int k = 0;
    while (k < kCellsInGuide && start.edge[k + 1] <= at) ++k;
    if (k < kCellsInGuide) return {int(start.first) + k, start.edge[k], start.edge[k + 1]};
    int cell = int(start.first) + k;
    uint32_t begin = start.edge[k], end = 0;
    const uint32_t* row = &lower[r * size_t(cells)];
    while ((end = upper(row, cell)) <= at) ++cell, begin = end;
    return {cell, begin, end};
}

PiecewiseConstant1D::Sample PiecewiseConstant1D::Steps::sample(double u, size_t r) const {
    const Found found = find(u, r);
    const uint32_t width = found.end - found.begin;
    const float f = std::min(float((u * kOne - found.begin) / width), kOneMinusEpsilon);
    return {point_in_cell(found.cell, f, cells), float(width) * (float(cells) / float(kOne)),
            found.cell};
}

float PiecewiseConstant1D::Steps::pdf(float x, size_t r) const {
    const uint32_t* row = &lower[r * size_t(cells)];
    const int cell = cell_of(x, cells);
    return float(upper(row, cell) - row[cell]) * (float(cells) / float(kOne));
}

PiecewiseConstant1D::PiecewiseConstant1D(std::span<const float> values)
    : steps_(int(values.size()), 1) {
    const double sum = sum_of(values);
    integral_ = sum / double(values.size());
    steps_.add(values, sum);
}

PiecewiseConstant2D::PiecewiseConstant2D(std::span<const float> values, int width, int height)
    : rows_(width, size_t(height)) {
    std::vector<float> sums;
    for (int y = 0; y < height; ++y) {
        const auto row = values.subspan(size_t(y) * size_t(width), size_t(width));
        const double sum = sum_of(row);
        rows_.add(row, sum);
        sums.push_back(float(sum / width));
    }
    marginal_ = PiecewiseConstant1D(sums);
}

PiecewiseConstant2D::Sample PiecewiseConstant2D::sample(FinePoint u) const {
    const auto y = marginal_.sample(u.y);
    const auto x = rows_.sample(u.x, size_t(y.cell));
    return {{x.x, y.x}, x.pdf * y.pdf};
}

float PiecewiseConstant2D::pdf(Vec2 uv) const {
    return rows_.pdf(uv.x, size_t(cell_of(uv.y, marginal_.size()))) * marginal_.pdf(uv.y);
}

}  // namespace etendue
