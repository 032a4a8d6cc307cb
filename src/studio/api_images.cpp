// Requests for images, and for values of their pixels.

#include <time.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>

#include <fmt/format.h>

#include "image/flip.h"
#include "image/metrics.h"
#include "render/aov.h"
#include "studio/api.h"
#include "studio/image_reply.h"
#include "studio/pixel_values.h"
#include "studio/reply_json.h"
#include "studio/request_values.h"
#include "studio/scene_data.h"

namespace etendue {
namespace {

using nlohmann::json;

double thread_cpu_seconds() {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

}  // namespace

void Api::image(const Request& request, const Done& done) {
    // The budget of snapshots includes all that this thread does, so what it did since the last image.
    const double cpu = thread_cpu_seconds();
    if (charged_ > 0 && cpu > charged_) session_.spent(cpu - charged_);
    charged_ = cpu;

    const std::shared_ptr<SceneData> data = this->data();
    const FilmGeometry& g = data->scene()->film();
    ImageHeader header;
    header.width = g.crop_width, header.height = g.crop_height;
    header.rect = {0, 0, g.crop_width, g.crop_height};
    header.level = query_integer(request, "level", 0);
    if (const auto rect = request.query("rect")) {
        ImageRect& r = header.rect;
        if (std::sscanf(rect->c_str(), "%9d,%9d,%9d,%9d", &r.x, &r.y, &r.width, &r.height) != 4)
            throw ApiError(400, "\"rect\" must be x,y,width,height");
    }
    check(header);
    const std::string view = request.query("view").value_or("image");
    const auto reply = [&](std::string body) {
        done({200, "application/octet-stream", std::move(body), {}});
    };
    if (view == "first")
        return later(done, [data] {
            const FirstPicture& p = data->first_picture();
            ImageHeader small;
            small.width = p.width, small.height = p.height;
            small.rect = {0, 0, p.width, p.height};
            return Reply{200, "application/octet-stream", encode_image(small, p.pixels), {}};
        });
    if (view == "reference") {
        if (!options_.reference) throw ApiError(404, "there is no reference");
        return reply(encode_image(header, options_.reference->pixels));
    }
    for (const AovInfo& a : aov_registry())
        if (view == a.name && view != "variance")
            return later(done, [data, header, view] {
                return Reply{
                    200, "application/octet-stream", encode_image(header, data->layer(view)), {}};
            });

    const int id = query_integer(request, "run", 0);
    const auto after = uint64_t(query_integer(request, "after", 0));
    header.run = uint32_t(id);
    const auto send = [&](uint64_t passes, int width, int height, const auto& pixels) {
        header.passes = passes;
        // A run of a scene that was loaded before may have another size.
        if (width != header.width || height != header.height)
            throw ApiError(409, "the run belongs to a scene of another size");
        reply(encode_image(header, std::span(std::as_const(pixels))));
    };
    const bool is_length = view.starts_with("length:");
    if (is_length || view.starts_with("technique:") || view.starts_with("unweighted:")) {
        const auto shown = session_.techniques(id);
        if (!shown || shown->passes <= after) return done({204, {}, {}, {}});
        const std::string number = view.substr(view.find(':') + 1);
        int index = -1;
        std::from_chars(number.data(), number.data() + number.size(), index);
        if (!is_length) {
            if (index < 0 || size_t(index) >= shown->images.size())
                throw ApiError(404, "there is no such technique");
            const TechniqueImages::Entry& e = shown->images[size_t(index)];
            return send(shown->passes, header.width, header.height,
                        view[0] == 't' ? e.weighted : e.unweighted);
        }
        std::vector<Rgb> sum(g.pixel_count());
        for (const TechniqueImages::Entry& e : shown->images)
            if (e.technique.vertices() - 1 == index && e.weighted.size() == sum.size())
                for (size_t i = 0; i < sum.size(); ++i) sum[i] += e.weighted[i];
        return send(shown->passes, header.width, header.height, sum);
    }
    const auto snapshot = session_.snapshot(id);
    if (!snapshot || snapshot->passes <= after) return done({204, {}, {}, {}});
    if (view == "image")
        return send(snapshot->passes, snapshot->width, snapshot->height, snapshot->mean);
    if (view == "variance")
        return send(snapshot->passes, snapshot->width, snapshot->height, snapshot->variance);
    if (view == "error")
        return send(snapshot->passes, snapshot->width, snapshot->height,
                    relative_errors(*snapshot));
    throw ApiError(404, fmt::format("there is no view \"{}\"", view));
}

Reply Api::pixel(const Request& request) {
    const int x = query_integer(request, "x", -1), y = query_integer(request, "y", -1),
              w = query_integer(request, "w", 1), h = query_integer(request, "h", 1),
              id = query_integer(request, "run", 0);
    const auto snapshot = session_.snapshot(id);
    if (!snapshot) return Reply::json(dump({{"run", id}, {"passes", 0}}));
    check(ImageHeader{.run = 0,
                      .passes = 0,
                      .width = snapshot->width,
                      .height = snapshot->height,
                      .rect = {x, y, w, h},
                      .level = 0});
    const RunStatus status = session_.status(id);
    const RectangleValues values = values_in(*snapshot, {x, y, w, h});
    json j{{"run", id},           {"passes", snapshot->passes},
           {"mean", values.mean}, {"interval", to_string(status.interval)},
           {"half", nullptr},     {"pixels", int64_t(w) * int64_t(h)},
           {"nan", values.nan},   {"infinite", values.infinite}};
    if (values.finite > 1) {
        j["least"] = values.least;
        j["largest"] = values.largest;
        j["variance"] = values.variance;
    }
    if (snapshot->passes >= 2 && status.interval != IntervalKind::None && values.finite > 0) {
        for (size_t c = 0; c < 3; ++c)
            j["half"][c] = interval_half_width(values.squared_error[c], snapshot->passes);
    }
    if (options_.reference && options_.reference->width == snapshot->width &&
        options_.reference->height == snapshot->height) {
        std::array<double, 3> value{};
        for_each_pixel({x, y, w, h}, snapshot->width, [&](size_t i) {
            for (int c = 0; c < 3; ++c)
                value[size_t(c)] +=
                    double(options_.reference->pixels[i][c]) / (double(w) * double(h));
        });
        j["reference"] = value;
    }
    return Reply::json(dump(j));
}

void Api::difference(const Request& request, const Done& done) {
    const auto snapshot = session_.snapshot(query_integer(request, "run", 0));
    const std::string against = request.query("against").value_or("");
    std::shared_ptr<const Snapshot> other;
    if (against != "reference")
        other = session_.snapshot(query_integer(request, "against", 0));
    else if (!options_.reference)
        throw ApiError(404, "there is no reference");
    if (!snapshot || (against != "reference" && !other))
        throw ApiError(422, "one of the images has no finished pass yet");
    const std::span<const Rgb> reference = other ? other->mean : options_.reference->pixels;
    const int width = other ? other->width : options_.reference->width;
    if (width != snapshot->width || reference.size() != snapshot->mean.size())
        throw ApiError(409, "the images differ in size");
    later(done, [snapshot, other, reference] {
        const ImageErrors errors = image_errors(snapshot->mean, reference);
        const FlipResult flip =
            hdr_flip(snapshot->mean, reference, snapshot->width, snapshot->height);
        return Reply::json(dump({{"rel_mse", errors.rel_mse},
                                 {"not_finite", errors.not_finite},
                                 {"flip", flip.mean},
                                 {"passes", snapshot->passes},
                                 {"against_passes", other ? other->passes : 0}}));
    });
}

void Api::gain(const Request& request, const Done& done) {
    const auto without = session_.seed_series(query_integer(request, "without", 0)),
               with = session_.seed_series(query_integer(request, "with", 0));
    later(done, [without, with] {
        const SeedComparison c = compare(*without, *with);
        json j{{"without", to_json(c.a, *without)},
               {"with", to_json(c.b, *with)},
               {"means_differ", c.means_differ}};
        if (c.is_valid) j["ratio"] = c.ratio, j["gain"] = {c.gain, c.low, c.high};
        return Reply::json(dump(j));
    });
}

Reply Api::techniques(const Request& request) {
    const auto shown = session_.techniques(query_integer(request, "run", 0));
    json list = json::array();
    if (shown)
        for (size_t i = 0; i < shown->images.size(); ++i) {
            json item = to_json(shown->images[i].technique);
            double sum = 0;
            for (const Rgb c : shown->images[i].weighted) sum += double(luminance(c));
            item["index"] = i;
            item["mean"] = sum / double(shown->images[i].weighted.size());
            list.push_back(std::move(item));
        }
    return Reply::json(dump({{"passes", shown ? shown->passes : 0}, {"techniques", list}}));
}

}  // namespace etendue
