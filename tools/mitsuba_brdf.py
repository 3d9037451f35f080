"""The BRDF of glsl/include/brdf.glsl as a BSDF of Mitsuba 3, with normal maps, for tools/mitsuba_scene.py. The fits of the lobe's
albedo are part of the definition; the rest is written down from it once more."""

ALPHA_MIN, COSINE_MIN = 2.0**-10, 2.0**-12
MATERIALS = []  # what the BSDFs are made of: factors and Mitsuba's textures; Mitsuba makes BSDFs by number


def define(mi):
    """Registers the BSDF `layered` with the variant of Mitsuba that is in use."""
    import drjit as dr

    def lobe_albedo(cosine, roughness):
        x, y = dr.clip(cosine, 0.03, 1), dr.maximum(roughness * roughness, ALPHA_MIN)
        p = 0.97403 + y * (-11.08942 + y * (426.76951 - 255.19079 * y))
        p += x * (-18.61348 + y * (136.33995 - 87.62469 * y) + x * (268.70304 - 239.89797 * y - 61.24613 * x))
        q = 1 + y * (-8.76324 + y * (413.30746 - 234.62415 * y))
        q += x * (-19.40884 + y * (158.33334 + 335.40212 * y) + x * (272.22361 - 306.77257 * y - 62.82817 * x))
        r = 1.0067 + y * (15.45131 - 4.19271 * y) + x * (-1.99403 - 17.0129 * y + 0.82439 * x)
        s = 1 + y * (35.36222 + y * (227.77088 + 86.80755 * y))
        s += x * (2.70334 + y * (-162.64114 + 749.12166 * y) + x * (6.58293 + 629.66126 * y + 22.68433 * x))
        whole = dr.clip(p / q, 0, 1)
        return whole, dr.clip(r / s, 0, whole)

    def through(f0, whole, schlick):
        return 1 - (f0 * (whole - schlick) + schlick)

    def layer_weight(f0, nl, nv, roughness):
        y = dr.maximum(roughness * roughness, ALPHA_MIN)
        whole = 1.00214 + y * (-0.13413 + y * (-1.86144 + y * (2.26377 - 0.8632 * y)))
        schlick = 0.04858 + y * (-0.16445 + y * (0.21085 - 0.09229 * y))
        mean = dr.maximum(through(f0, dr.minimum(whole, 1), schlick), 1 / 256)
        return through(f0, *lobe_albedo(nl, roughness)) * through(f0, *lobe_albedo(nv, roughness)) / mean

    class Layered(mi.BSDF):
        """The BRDF of glsl/include/brdf.glsl, with the normal map. All in world space, about the normal on the viewer's side."""

        def __init__(self, props):
            super().__init__(props)
            self.material = MATERIALS[int(props["number"])]
            flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            self.m_components = [flags]
            self.m_flags = flags

        def surface(self, si, active):
            m = self.material
            base, mr = mi.Color3f(m["base"]), mi.Color3f(1)
            if "base_map" in m:
                base *= m["base_map"].eval(si, active)
            if "color" in m:
                base *= mi.Color3f(m["color"].eval_3(si, active))
            if "mr_map" in m:
                mr = mi.Color3f(m["mr_map"].eval_3(si, active))
            n = mi.Vector3f(si.sh_frame.n)
            if "normal_map" in m:
                n = self.mapped(si, n, active)
            view = si.to_world(si.wi)
            side = dr.sign(dr.dot(si.n, view))
            return base, m["metallic"] * mr.z, m["roughness"] * mr.y, n * side, view, si.n * side

        def mapped(self, si, n, active):
            m = self.material
            if "tangent" in m:
                t, hand = mi.Vector3f(m["tangent"].eval_3(si, active)), m["handedness"].eval_1(si, active)
                t = dr.normalize(t - n * dr.dot(n, t))
                b = dr.cross(n, t) * dr.select(hand < 0, -1.0, 1.0)
            else:  # what the texture coordinates say in this triangle; v points down, the map's green up
                t = dr.normalize(si.dp_du - n * dr.dot(n, si.dp_du))
                b = dr.cross(n, t)
                b = dr.select(dr.dot(b, si.dp_dv) > 0, -b, b)
            v = mi.Vector3f(m["normal_map"].eval_3(si, active)) * 2 - 1
            return dr.normalize(t * (v.x * m["scale"]) + b * (v.y * m["scale"]) + n * v.z)

        def value(self, surface, light):
            base, metallic, roughness, n, view, geometric = surface
            nl, nv = dr.minimum(dr.dot(n, light), 1), dr.clip(dr.dot(n, view), COSINE_MIN, 1)
            f0 = 0.04 * (1 - metallic) + base * metallic
            diffuse = base * (1 - metallic) * layer_weight(f0, nl, nv, roughness) * nl / dr.pi
            half = dr.normalize(light + view)
            a2 = dr.square(dr.maximum(roughness * roughness, ALPHA_MIN))
            d = a2 / (dr.pi * dr.square(a2 * dr.square(dr.dot(n, half)) + dr.squared_norm(dr.cross(n, half))))
            root = lambda c: dr.sqrt(c * c * (1 - a2) + a2)
            g = 0.5 / (nl * root(nv) + nv * root(nl))
            fresnel = f0 + (1 - f0) * dr.maximum(1 - dr.dot(view, half), 0) ** 5
            # What is behind the triangle itself gives it no light, whatever the shading normal says.
            lit = (nl > 0) & (dr.dot(geometric, light) > 0)
            return dr.select(lit, diffuse + fresnel * (d * g * nl), 0)

        def density(self, surface, light):
            _, _, roughness, n, view, _ = surface
            half = dr.normalize(light + view)
            alpha = dr.maximum(roughness * roughness, ALPHA_MIN)
            nh = dr.dot(n, half)
            d = dr.square(alpha) / (dr.pi * dr.square(dr.square(alpha * nh) + dr.squared_norm(dr.cross(n, half))))
            lobe = d * dr.maximum(nh, 0) / (4 * dr.maximum(dr.dot(view, half), 1e-6))
            return 0.5 * lobe + 0.5 * dr.maximum(dr.dot(n, light), 0) / dr.pi

        def sample(self, ctx, si, sample1, sample2, active=True):
            surface = self.surface(si, active)
            _, _, roughness, n, view, _ = surface
            frame = mi.Frame3f(n)
            alpha = dr.maximum(roughness * roughness, ALPHA_MIN)
            sin, cos = dr.sincos(2 * dr.pi * sample2.x)
            z = dr.sqrt((1 - sample2.y) / (1 + (dr.square(alpha) - 1) * sample2.y))
            r = dr.safe_sqrt(1 - z * z)
            half = frame.to_world(mi.Vector3f(r * cos, r * sin, z))
            mirrored = 2 * dr.dot(view, half) * half - view
            spread = frame.to_world(mi.warp.square_to_cosine_hemisphere(sample2))
            light = dr.select(sample1 < 0.5, mirrored, spread)
            bs = mi.BSDFSample3f()
            bs.wo, bs.eta, bs.pdf = si.to_local(light), 1, self.density(surface, light)
            bs.sampled_type, bs.sampled_component = mi.UInt32(+mi.BSDFFlags.GlossyReflection), 0
            good = active & (bs.pdf > 0) & dr.isfinite(bs.pdf)
            return bs, dr.select(good, self.value(surface, light) / bs.pdf, 0)

        def eval(self, ctx, si, wo, active=True):
            return dr.select(active, self.value(self.surface(si, active), si.to_world(wo)), 0)

        def pdf(self, ctx, si, wo, active=True):
            return dr.select(active, self.density(self.surface(si, active), si.to_world(wo)), 0)

        def eval_pdf(self, ctx, si, wo, active=True):
            return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

        def to_string(self):
            return "Layered[]"

    mi.register_bsdf("layered", Layered)
