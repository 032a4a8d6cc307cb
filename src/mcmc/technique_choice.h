#pragma once
// Probabilities with which independent samples of single paths choose the length and the technique: four fifths in
// proportion to the light that a pilot run found, and one fifth by a fixed distribution.

#include <map>
#include <utility>
#include <vector>

#include "scene/scene.h"

namespace etendue {

/// Light by length and technique: (edges, s). Empty if nothing is known of it.
using TechniqueLight = std::map<std::pair<int, int>, double>;

/// Whether eye paths can hit an emitter.
bool hits_emitters(const Scene& scene);

/// p(s|k) of C(s, k+1-s): four fifths in proportion to the light of each technique, one fifth uniform over the techniques.
class TechniqueChoice {
public:
    /// Tabulates `lengths` path lengths from `shortest` on; at longer paths all techniques are equally likely. C(0,k+1) and
    /// C(k+1,0) exist where eye paths can hit an emitter, and light paths the lens.
    TechniqueChoice(const Scene& scene, int shortest, int lengths, const TechniqueLight& light);
    double pmf(int k, int s) const;
    int choose(int k, double u) const;
    /// The inverse of choose(): a number that chooses s, uniformly distributed among these if v is so in [0, 1).
    double number(int k, int s, double v) const;

private:
    bool is_allowed(int k, int s) const { return s == 0 ? hits_ : s == k + 1 ? hits_lens_ : true; }
    int allowed(int k) const { return k + hits_ + hits_lens_; }

    int shortest_;
    bool hits_, hits_lens_;
    std::vector<std::vector<double>> pmf_;  ///< By length, then s.
};

/// p(k): four fifths in proportion to the light of each length, one fifth geometric, so that every length is possible. The
/// ratio of the latter is fitted to the pilot: if light decreased more slowly with the length than p(k) does, the few
/// longest paths would have arbitrarily large weights.
class LengthChoice {
public:
    LengthChoice(int shortest, int longest, const TechniqueLight& light);
    double pmf(int k) const;
    int choose(double u) const;
    /// The inverse of choose(), as that of TechniqueChoice.
    double number(int k, double v) const;

private:
    void fit_ratio();
    double geometric(int k) const;
    double computed_pmf(int k) const;

    int shortest_, longest_;
    double ratio_ = 0.75;  ///< Of the probabilities of successive lengths of the geometric part.
    double by_energy_ = 0;
    std::vector<double> energy_;  ///< Shares of the light, from the shortest length on.
    std::vector<double> pmf_;     ///< Of the shortest lengths.
};

}  // namespace etendue
