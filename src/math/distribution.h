#pragma once
// Tabulated distributions: alias table over indices, piecewise-constant densities in one and two dimensions.

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "math/vec.h"

namespace etendue {

/// (i + u) / n: the point u in [0, 1) of the i-th of n equal parts of [0, 1); always below 1.
inline double stratum(int i, int n, double u) {
    return std::fmin((double(i) + u) / double(n), 0x1.fffffffffffffp-1);
}

/// Draws an index with probability proportional to its weight in constant time [Walker 1977; Vose 1991].
class AliasTable {
public:
    AliasTable() = default;
    /// Weights must be finite and not negative; a table whose weights are all zero is empty.
    explicit AliasTable(std::span<const double> weights);

    struct Draw {
        uint32_t index;
        float pmf;
        /// The argument rescaled to [0, 1), for reuse; about log2(size() / keep) of its bits are lost.
        double u;
    };
    /// For `u` with 53 bits, the frequency of an index of probability p has a relative error of up to 2^-53 size() / p.
    Draw sample(double u) const;
    float pmf(uint32_t i) const { return cells_[i].pmf; }
    double total() const { return total_; }
    size_t size() const { return cells_.size(); }
    bool empty() const { return cells_.empty(); }

private:
    struct Cell {
        double keep;  ///< Probability of the cell's own index; `alias` is taken otherwise.
        uint32_t alias;
        float pmf;
    };
    std::vector<Cell> cells_;
    double total_ = 0;
};

/// Piecewise-constant density on [0, 1), proportional to `values` (not negative); uniform where all are zero.
class PiecewiseConstant1D {
public:
    PiecewiseConstant1D() = default;
    explicit PiecewiseConstant1D(std::span<const float> values);
    /// Position in [0, 1), its density, and the cell it fell in.
    struct Sample {
        float x, pdf;
        int cell;
    };
    Sample sample(double u) const;
    float pdf(float x) const;
    double integral() const { return integral_; }
    int size() const { return int(values_.size()); }

private:
    std::vector<float> values_;
    std::vector<double> cdf_;
    double integral_ = 0;
};

/// Piecewise-constant density on [0, 1)²; `values` are those of `width` × `height` cells, row by row.
class PiecewiseConstant2D {
public:
    PiecewiseConstant2D() = default;
    PiecewiseConstant2D(std::span<const float> values, int width, int height);
    struct Sample {
        Vec2 uv;
        float pdf;
    };
    Sample sample(FinePoint u) const;
    float pdf(Vec2 uv) const;
    double integral() const { return marginal_.integral(); }

private:
    std::vector<PiecewiseConstant1D> rows_;
    PiecewiseConstant1D marginal_;
};

}  // namespace etendue
