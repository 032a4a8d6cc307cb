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

}  // namespace

PiecewiseConstant1D::PiecewiseConstant1D(std::span<const float> values)
    : values_(values.begin(), values.end()), cdf_(values.size() + 1) {
    const double n = double(values_.size());
    std::vector<double> sum(values_.size() + 1, 0.0);
    for (size_t i = 0; i < values_.size(); ++i) sum[i + 1] = sum[i] + values_[i] / n;
    integral_ = sum.back();
    for (size_t i = 0; i < sum.size(); ++i)
        cdf_[i] = integral_ > 0 ? sum[i] / integral_ : double(i) / n;
    cdf_.back() = 1;
    for (float& v : values_) v = integral_ > 0 ? float(v / integral_) : 1.0f;
}

PiecewiseConstant1D::Sample PiecewiseConstant1D::sample(double u) const {
    // First cell whose upper bound exceeds u; cells of zero width cannot be chosen.
    const auto it = std::upper_bound(cdf_.begin() + 1, cdf_.end() - 1, u);
    const int i = int(it - cdf_.begin()) - 1;
    const double width = cdf_[i + 1] - cdf_[i];
    const float f = width > 0 ? std::min(float((u - cdf_[i]) / width), kOneMinusEpsilon) : 0.5f;
    return {point_in_cell(i, f, size()), values_[i], i};
}

float PiecewiseConstant1D::pdf(float x) const {
    return values_[cell_of(x, size())];
}

PiecewiseConstant2D::PiecewiseConstant2D(std::span<const float> values, int width, int height) {
    std::vector<float> sums;
    for (int y = 0; y < height; ++y) {
        rows_.emplace_back(values.subspan(size_t(y) * width, width));
        sums.push_back(float(rows_.back().integral()));
    }
    marginal_ = PiecewiseConstant1D(sums);
}

PiecewiseConstant2D::Sample PiecewiseConstant2D::sample(FinePoint u) const {
    const auto y = marginal_.sample(u.y);
    const auto x = rows_[y.cell].sample(u.x);
    return {{x.x, y.x}, x.pdf * y.pdf};
}

float PiecewiseConstant2D::pdf(Vec2 uv) const {
    return rows_[cell_of(uv.y, int(rows_.size()))].pdf(uv.x) * marginal_.pdf(uv.y);
}

}  // namespace etendue
