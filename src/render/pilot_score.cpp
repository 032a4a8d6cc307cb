#include "render/pilot_score.h"

#include <algorithm>
#include <cmath>

#include "math/statistics.h"

namespace etendue {
namespace {

/// The mean less its standard error; 0 where the difference is a matter of rounding: the error of light that only one of the
/// values has is its mean.
double low_mean(const Moments& m) {
    constexpr double kRounding = 1e-9;
    const double low = m.mean() - std::sqrt(m.squared_error());
    return low > kRounding * m.mean() ? low : 0.0;
}

/// Variance of independent values, of which differences d beyond V count V |d| instead of d². From pairs, since a mean would
/// have a part of a spike. Values of one sequence of `in_sequence` are no pair.
double limited_variance(const std::vector<double>& values, double V, int in_sequence = 1) {
    const auto together = size_t(in_sequence);
    double sum = 0;
    size_t pairs = 0;
    for (size_t i = 0; i < values.size(); ++i)
        for (size_t j = 0; j < i - i % together; ++j) {
            const double d = std::abs(values[i] - values[j]);
            sum += std::min(d, V) * d;
            ++pairs;
        }
    return pairs > 0 ? sum / double(2 * pairs) : 0.0;
}

/// Parts of the film, of about equal size.
struct Tiles {
    int width, height, columns, rows;

    int count() const { return columns * rows; }
    int of(int x, int y) const { return y * rows / height * columns + x * columns / width; }
};

class Scores {
public:
    Scores(std::span<const PilotImages> methods, int width, int height)
        : methods_(methods), width_(width), height_(height),
          finest_(tiles(kMostColumns, kMostRows)) {}

    std::vector<PilotScore> all() const {
        constexpr int kGroups = 4;
        std::vector<PilotScore> scores(methods_.size());
        for (size_t i = 0; i < methods_.size(); ++i) scores[i].has_light = has_light(methods_[i]);
        add_noise(scores);
        for (const Tiles& t :
             {finest_, tiles(kMostColumns / kGroups, kMostRows / kGroups), tiles(1, 1)})
            add_missing(t, scores);
        return scores;
    }

private:
    // Tiles with few pixels have uncertain means; with many, light that is missing in a part of them does not show.
    static constexpr int kMostColumns = 16, kMostRows = 12;
    Tiles tiles(int columns, int rows) const {
        return {width_, height_, std::min(columns, width_), std::min(rows, height_)};
    }
    static bool has_light(const PilotImages& of) {
        return std::any_of(of.images.begin(), of.images.end(), [](const auto& image) {
            return std::any_of(image.begin(), image.end(), [](float value) { return value > 0; });
        });
    }
    /// The mean of a tile in each image of a method.
    std::vector<Moments> estimates(const Tiles& tiles, const PilotImages& of) const {
        const auto count = size_t(tiles.count());
        std::vector<Moments> all(count);
        std::vector<double> pixels(count);
        for (int y = 0; y < height_; ++y)
            for (int x = 0; x < width_; ++x) ++pixels[size_t(tiles.of(x, y))];
        for (const std::vector<float>& image : of.images) {
            std::vector<double> sums(count);
            for (int y = 0; y < height_; ++y)
                for (int x = 0; x < width_; ++x)
                    sums[size_t(tiles.of(x, y))] += double(image[pixel(x, y)]);
            for (size_t t = 0; t < count; ++t) all[t].add(sums[t] / pixels[t]);
        }
        return all;
    }
    /// The estimates of all methods by tile, and µ of each tile: the largest mean less its error. Spikes have large errors,
    /// and methods that miss light small means.
    struct Means {
        std::vector<std::vector<Moments>> by_method;
        std::vector<double> mu;
        double whole = 0;  ///< m

        double norm(size_t tile) const { return mu[tile] * mu[tile] + 0.01 * whole * whole; }
        /// V of a tile for a rendering of N images. Where the tile is dark, the light of the film is what spikes stand out
        /// from.
        double limit(size_t tile, double N) const {
            return std::max(mu[tile], 0.1 * whole) * std::max(16.0, N);
        }
    };
    Means means(const Tiles& tiles) const {
        Means m;
        for (const PilotImages& of : methods_) m.by_method.push_back(estimates(tiles, of));
        for (size_t t = 0; t < size_t(tiles.count()); ++t) {
            m.mu.push_back(0);
            for (const auto& of : m.by_method) m.mu.back() = std::max(m.mu.back(), low_mean(of[t]));
            m.whole += m.mu.back() / double(tiles.count());
        }
        return m;
    }

    void add_noise(std::vector<PilotScore>& scores) const {
        const Tiles& tiles = finest_;
        const Means m = means(tiles);
        if (!(m.whole > 0)) return;
        for (size_t i = 0; i < methods_.size(); ++i) {
            const PilotImages& of = methods_[i];
            const auto& images = of.images;
            const double N = of.horizon;
            const auto together = size_t(of.in_sequence);
            std::vector<double> values(images.size()), means(images.size() / together);
            double sum = 0, of_sequences = 0;
            for (int y = 0; y < height_; ++y)
                for (int x = 0; x < width_; ++x) {
                    const auto tile = size_t(tiles.of(x, y));
                    const double V = m.limit(tile, N);
                    std::fill(means.begin(), means.end(), 0.0);
                    for (size_t k = 0; k < images.size(); ++k) {
                        values[k] = double(images[k][pixel(x, y)]);
                        means[k / together] += values[k] / double(together);
                    }
                    sum += limited_variance(values, V, of.in_sequence) / m.norm(tile);
                    of_sequences += limited_variance(means, V / double(together)) / m.norm(tile);
                }
            scores[i].noise = sum / (double(width_) * double(height_)) / N;
            if (of.in_sequence > 1 && sum > 0)
                scores[i].noise *= std::min(1.0, double(of.in_sequence) * of_sequences / sum);
            if (methods_[i].pixels_in_one > 1)
                scores[i].noise = std::min(
                    scores[i].noise, std::max(scores[i].noise * of_small_pixels(methods_[i], m),
                                              methods_[i].least_variance / N));
        }
    }

    /// The factor by which the noise of chains is smaller in the pixels of the rendering.
    double of_small_pixels(const PilotImages& of, const Means& m) const {
        const double one = variance_of_blocks(of, m, 1), four = variance_of_blocks(of, m, 2);
        if (!(one > 0)) return 1;
        const double f = std::clamp(4 * four / one, 1.0, 4.0);
        return std::pow(of.pixels_in_one, -std::log(f) / std::log(4.0));
    }
    /// Variance of the means of blocks of side × side pixels, limited as that of pixels, and relative to the tiles.
    double variance_of_blocks(const PilotImages& of, const Means& m, int side) const {
        const double area = double(side) * double(side);
        double sum = 0;
        for (int y = 0; y + side <= height_; y += side)
            for (int x = 0; x + side <= width_; x += side) {
                const auto tile = size_t(finest_.of(x, y));
                const double V = m.limit(tile, of.horizon) / area;
                std::vector<double> values;
                for (const auto& image : of.images) {
                    double value = 0;
                    for (int j = 0; j < side; ++j)
                        for (int i = 0; i < side; ++i)
                            value += double(image[pixel(x + i, y + j)]) / area;
                    values.push_back(value);
                }
                sum += limited_variance(values, V) / m.norm(tile);
            }
        return sum / double((width_ / side) * (height_ / side));
    }

    void add_missing(const Tiles& tiles, std::vector<PilotScore>& scores) const {
        constexpr double kDoubt = 0.01;  // over all tiles
        const Means m = means(tiles);
        if (!(m.whole > 0)) return;
        const auto count = size_t(tiles.count());
        for (size_t i = 0; i < methods_.size(); ++i) {
            std::vector<double> lacks(count);
            const bool is_certain = count == 1 && !scores[i].has_light;
            for (size_t j = 0; j < methods_.size(); ++j) {
                const size_t images =
                    std::min(methods_[i].images.size(), methods_[j].images.size());
                const double errors =
                    is_certain ? 0.0
                               : student_quantile(2 * kDoubt / double(count), double(images) - 1);
                for (size_t t = 0; t < count; ++t) {
                    const Moments &own = m.by_method[i][t], &other = m.by_method[j][t];
                    const double error = std::sqrt(own.squared_error() + other.squared_error());
                    lacks[t] = std::max(lacks[t], other.mean() - own.mean() - errors * error);
                }
            }
            const double N = methods_[i].horizon;
            double sum = 0;
            for (size_t t = 0; t < count; ++t) sum += m.limit(t, N) * lacks[t] / (N * m.norm(t));
            scores[i].missing = std::max(scores[i].missing, sum / double(count));
        }
    }

    size_t pixel(int x, int y) const { return size_t(y) * size_t(width_) + size_t(x); }

    std::span<const PilotImages> methods_;
    int width_, height_;
    Tiles finest_;
};

}  // namespace

std::vector<PilotScore> score_pilots(std::span<const PilotImages> methods, int width, int height) {
    return Scores(methods, width, height).all();
}

std::vector<double> reuse_factors(std::span<const NoiseOfFilms> methods, double growth,
                                  double ratio) {
    const double most_gain = std::pow(kMostGainOfReuse, std::log(growth) / std::log(4.0));
    std::vector<double> gains;
    double of_others = 0;
    for (const NoiseOfFilms& m : methods) {
        const NoiseOfFilms& known = m.like >= 0 ? methods[size_t(m.like)] : m;
        gains.push_back(known.before > 0 && known.now > 0 ? known.before / known.now : 1.0);
        if (m.kind == NoiseOfFilms::Kind::Independent)
            of_others = std::max(of_others, gains.back());
    }
    for (size_t i = 0; i < gains.size(); ++i) {
        const bool gains_further = methods[i].kind == NoiseOfFilms::Kind::Reuse && of_others > 0;
        const double gain = gains_further ? gains[i] / of_others : 1.0;
        gains[i] = std::pow(std::clamp(gain, 1.0, most_gain), -std::log(ratio) / std::log(growth));
    }
    return gains;
}

}  // namespace etendue
