#pragma once
// Tabulated distributions: alias table over indices, piecewise-constant densities in one and two dimensions.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "math/prefetch.h"
#include "math/vec.h"

namespace etendue {

/// (i + u) / n: the point u in [0, 1) of the i-th of n equal parts of [0, 1); always below 1.
inline double stratum(int i, int n, double u) {
    return std::min(0x1.fffffffffffffp-1, (double(i) + u) / double(n));
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
    size_t memory_bytes() const { return cells_.capacity() * sizeof(Cell); }

private:
    struct Cell {
        double keep;  ///< Probability of the cell's own index; `alias` is taken otherwise.
        uint32_t alias;
        float pmf;
    };
    std::vector<Cell> cells_;
    double total_ = 0;
};

/// Piecewise-constant density on [0, 1), proportional to `values` (not negative); uniform where all are zero. Sampling
/// inverts the distribution function, so it is monotone: what is stratified or changes little stays so. It takes
/// constant time on average and mostly touches one cache line [Chen & Asau 1974]. Probabilities are multiples of
/// 2^-31, and pdf() is the density of exactly what is sampled. It is above zero wherever a value is.
class PiecewiseConstant1D {
public:
    PiecewiseConstant1D() = default;
    explicit PiecewiseConstant1D(std::span<const float> values);
    /// Position in [0, 1), its density, and the cell it fell in.
    struct Sample {
        float x, pdf;
        int cell;
    };
    Sample sample(double u) const { return steps_.sample(u, 0); }
    float pdf(float x) const { return steps_.pdf(x, 0); }
    double integral() const { return integral_; }
    int size() const { return steps_.cells; }

private:
    friend class PiecewiseConstant2D;
    /// Distribution functions of the rows of an image, each with its cells and its guide.
    struct Steps {
        static constexpr uint32_t kOne = 1u << 31;
        static constexpr int kCellsPerGuide = 4, kCellsInGuide = 6;
        /// Where the search begins: a cell, and the edges of the cells from it on, so that most searches need nothing
        /// else. It never extends over two cache lines.
        struct alignas(32) Guide {
            uint32_t first;
            uint32_t edge[kCellsInGuide + 1];
        };

        int cells = 0, guides = 0;
        std::vector<uint32_t>
            lower;  ///< By row and cell: the distribution function at its lower edge, times kOne.
        std::vector<Guide> guide;  ///< By row and part of kOne.

        Steps() = default;
        Steps(int cells, size_t rows);
        /// Appends a row.
        void add(std::span<const float> values, double sum);
        uint32_t upper(const uint32_t* row, int cell) const {
            return cell + 1 < cells ? row[cell + 1] : kOne;
        }
        /// The cell where `u` lies, between two values of the distribution function.
        struct Found {
            int cell;
            uint32_t begin, end;
        };
        Found find(double u, size_t row) const;
        Sample sample(double u, size_t row) const;
        /// Where find() begins.
        const Guide& guide_of(double u, size_t row) const {
            const uint64_t at = uint32_t(u * kOne);
            return guide[row * size_t(guides) + size_t(at * uint64_t(guides) >> 31)];
        }
        float pdf(float x, size_t row) const;
        size_t memory_bytes() const {
            return lower.capacity() * sizeof(lower[0]) + guide.capacity() * sizeof(guide[0]);
        }
    };
    Steps steps_;
    double integral_ = 0;
};

/// Piecewise-constant density on [0, 1)²; `values` are those of `width` × `height` cells, row by row. See above.
class PiecewiseConstant2D {
public:
    PiecewiseConstant2D() = default;
    PiecewiseConstant2D(std::span<const float> values, int width, int height);
    struct Sample {
        Vec2 uv;
        float pdf;
    };
    Sample sample(FinePoint u) const;
    /// The row of the cell that sample() falls in. Asks for the memory that cell() and sample() read of it.
    int prefetch_row(FinePoint u) const {
        const int y = marginal_.steps_.find(u.y, 0).cell;
        prefetch(rows_.guide_of(u.x, size_t(y)));
        return y;
    }
    /// The number within its row of the cell that sample() falls in.
    int cell(FinePoint u, int row) const { return rows_.find(u.x, size_t(row)).cell; }
    float pdf(Vec2 uv) const;
    double integral() const { return marginal_.integral(); }
    size_t memory_bytes() const { return rows_.memory_bytes() + marginal_.steps_.memory_bytes(); }
    /// Calls `use` with each array whose size is that of the image.
    template <class Use>
    void for_each_large_array(const Use& use) const {
        use(rows_.lower);
        use(rows_.guide);
    }

private:
    PiecewiseConstant1D::Steps rows_;
    PiecewiseConstant1D marginal_;
};

}  // namespace etendue
