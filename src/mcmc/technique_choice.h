#pragma once
// How independent samples of one path each choose its length and technique: by what a pilot found, and a fifth otherwise.

#include <vector>

#include "mcmc/pilot.h"

namespace etendue {

/// p(s|k) of C(s, k+1-s): by the energy of each technique, and a fifth uniform over those that there are.
class TechniqueChoice {
public:
    /// Tabulates `lengths` of them from `shortest` on; beyond, all techniques are as likely. `hits`, `hits_lens`: whether
    /// there are C(0,k+1) and C(k+1,0).
    TechniqueChoice(int shortest, int lengths, bool hits, bool hits_lens, const Pilot& pilot);
    double pmf(int k, int s) const;
    int choose(int k, double u) const;

private:
    bool is_allowed(int k, int s) const { return s == 0 ? hits_ : s == k + 1 ? hits_lens_ : true; }
    int allowed(int k) const { return k + hits_ + hits_lens_; }

    int shortest_;
    bool hits_, hits_lens_;
    std::vector<std::vector<double>> pmf_;  ///< By length, then s.
};

/// p(k): by energy, and a fifth geometric, so that every length has some.
class LengthChoice {
public:
    LengthChoice(int shortest, int longest, const Pilot& pilot);
    double pmf(int k) const;
    int choose(double u) const;

private:
    static constexpr double kLonger = 0.75;
    double geometric(int k) const;

    int shortest_, longest_;
    double by_energy_ = 0;
    std::vector<double> energy_;  ///< Shares, from the shortest length on.
};

}  // namespace etendue
