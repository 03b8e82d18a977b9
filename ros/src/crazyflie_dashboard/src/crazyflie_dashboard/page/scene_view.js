// The vehicles and what is around them in three dimensions.

import { CSS2DRenderer, OrbitControls, THREE } from "nicegui-scene";
import { FEW, Goal, Measure, Surroundings, Vehicles, Waypoints, axesOf } from "dashboard-objects";

const LABEL_PERIOD = 0.2;  // Between two layouts of more names than FEW, s: they cost more than all else.
const FLOOR = "uniform vec3 color; void main() { gl_FragColor = linearToOutputTexel(vec4(color, 1.0)); }";  // It is most of the picture.
const CLICK = 5;  // A pointer that has moved further, px, has turned the view.

export default {
  template: `<div class="scene"><canvas></canvas><div class="labels"></div>
    <div class="no-webgl" style="display:none"></div></div>`,

  props: { model: Array },

  mounted() {
    try {
      this.setRenderer(true);
    } catch (error) {
      this.$el.children[2].textContent =
        "This browser offers no WebGL 2: the scene cannot be drawn. All else works.";
      this.$el.children[2].style.display = "";
      return;
    }
    this.labels = new CSS2DRenderer({ element: this.$el.children[1] });
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(45, 1, 0.02, 500);
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(-2.6, -3.2, 2.6);
    this.controls = new OrbitControls(this.camera, this.$el);
    this.controls.target.set(0, 0, 0.4);
    this.controls.maxPolarAngle = 1.55;
    const sun = new THREE.DirectionalLight("#ffffff", 1.6);
    sun.position.set(3, -5, 8);
    const floor = new THREE.Mesh(new THREE.CircleGeometry(14, 64),
      new THREE.ShaderMaterial({ fragmentShader: FLOOR, uniforms: { color: { value: new THREE.Color() } } }));
    floor.position.z = -0.004;
    this.floor = floor;
    const grid = this.grid = new THREE.GridHelper(20, 20, "#56657a", "#2f3947").rotateX(Math.PI / 2);
    this.surroundings = new Surroundings();
    this.goal = new Goal();
    this.waypoints = new Waypoints();
    this.measure = new Measure();
    this.scene.add(new THREE.HemisphereLight("#ffffff", "#30343c", 2.2), sun, floor, grid,
      axesOf(0.3), this.surroundings, this.goal, this.waypoints, this.measure);
    this.setVehicles([]);
    this.setColors();
    matchMedia("(prefers-color-scheme: light)").addEventListener("change", () => this.setColors());
    this.listen();
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(this.$el);
    this.controls.addEventListener("change", () => { this.isOld = true; });
    // The connection is made after all parts of the page.
    this.waiting = setInterval(() => {
      if (!window.socket) return;
      clearInterval(this.waiting);
      window.socket.on("vehicles", (rows, taken) => {
        this.update(JSON.parse(rows));
        taken?.();
      });
      this.$emit("ready");
    }, 20);
  },

  beforeUnmount() {
    clearInterval(this.waiting);
    this.observer?.disconnect();
    this.renderer?.setAnimationLoop(null);
    this.renderer?.dispose();
  },

  methods: {
    // Draw on a new canvas: whether edges are smooth cannot be changed on an old one.
    setRenderer(isSmooth) {
      const canvas = document.createElement("canvas");
      const renderer = new THREE.WebGLRenderer({ antialias: isSmooth, canvas });
      this.renderer?.setAnimationLoop(null);
      this.renderer?.forceContextLoss();
      this.$el.children[0].replaceWith(canvas);
      const isSoftware = this.drawsInSoftware(renderer.getContext());
      Object.assign(this, { canvas, renderer, isSmooth, isSoftware });
      renderer.setAnimationLoop((time) => this.draw(time / 1000));
    },

    // Tell whether pictures are drawn without a graphics card.
    drawsInSoftware(gl) {
      const names = gl.getExtension("WEBGL_debug_renderer_info");
      return /swiftshader|llvmpipe|software/i.test(gl.getParameter(names?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER));
    },

    resize() {
      const { clientWidth: width, clientHeight: height } = this.$el;
      this.renderer.setSize(width, height);
      this.labels.setSize(width, height);
      this.camera.aspect = width / Math.max(1, height);
      this.camera.updateProjectionMatrix();
      this.isOld = true;
    },

    // Draw what has changed; a scene in which nothing moves costs nothing. Without a graphics card,
    // propellers that turn at the same place are no reason: a picture costs 25 ms of a processor.
    draw(time) {
      const place = this.following && this.vehicles.positionOf(this.following);
      if (place) {
        this.camera.position.add(place.clone().sub(this.controls.target));
        this.controls.target.copy(place);
      }
      this.controls.update();
      if (!this.isOld && (this.isSoftware || !this.vehicles.isTurning)) return;
      this.isOld = false;
      this.vehicles.place(this.camera, time);
      this.renderer.render(this.scene, this.camera);
      if (this.vehicles.names.length > FEW && time < (this.nextLabels ?? 0)) return;
      this.nextLabels = time + LABEL_PERIOD;
      this.labels.render(this.scene, this.camera);
    },

    setVehicles(names) {
      if (names.length > FEW && this.isSmooth && this.isSoftware) {
        this.setRenderer(false);
        this.resize();
      }
      this.vehicles?.dispose();
      this.vehicles = new Vehicles(names, this.model);
      this.scene.add(this.vehicles);
    },

    // Change the scene; without WebGL there is none.
    change(act) {
      if (!this.renderer) return;
      act();
      this.isOld = true;
    },
    update(poses) {
      this.poses = poses;
      if (poses.length !== this.vehicles?.names.length) return;  // The names that they belong to come later.
      this.change(() => this.vehicles.update(poses));
      const count = poses.filter(([x]) => x !== null).length;
      if (this.isTouched || count <= (this.count ?? 0)) return;
      this.count = count;
      this.look("all");
    },
    // While an earlier moment is shown, there are no trails.
    setPast(isPast) { this.change(() => this.vehicles.setPast(isPast)); },
    setNames(names) {
      this.change(() => this.setVehicles(names));
      if (this.poses) this.update(this.poses);
    },
    setSolids(solids) { this.change(() => this.surroundings.setSolids(solids)); },
    placeSolids(places) { this.change(() => this.surroundings.placeSolids(places)); },
    setFences(fences) { this.change(() => this.surroundings.setFences(fences)); },
    setPaths(paths) { this.change(() => this.surroundings.setPaths(paths)); },
    setFrames(frames) { this.change(() => this.surroundings.setFrames(frames)); },
    setWaypoints(points) { this.change(() => this.waypoints.show(points)); },
    setWaypointing(isOn) { this.isWaypointing = isOn; },
    setGoal(goal) { this.change(() => this.goal.show(goal)); },

    // Look from above, at all, or follow the vehicle of a name until another view is chosen.
    look(view, name) {
      if (!this.renderer) return;
      const followed = view === "follow" ? this.vehicles.positionOf(name) : null;
      if (view === "follow" && !followed) return;
      this.following = followed ? name : null;
      const box = new THREE.Box3(new THREE.Vector3(-1, -1, 0), new THREE.Vector3(1, 1, 1));
      for (const each of this.vehicles.names) {
        const place = this.vehicles.positionOf(each);
        if (place) box.expandByPoint(place);
      }
      for (const plan of [this.surroundings.paths, this.waypoints]) box.expandByObject(plan);
      const target = followed ?? box.getCenter(new THREE.Vector3());
      // A picture that is higher than wide has less to its sides.
      const narrow = Math.max(1, 1 / this.camera.aspect);
      const far = followed ? 1.5 : box.getSize(new THREE.Vector3()).length() * narrow;
      const way = view === "above" ? [0, -0.001, 1.3] : [-0.6, -0.9, 0.7];
      this.controls.target.copy(target);
      this.camera.position.copy(target).add(new THREE.Vector3(...way).multiplyScalar(far));
    },

    ray(event) {
      const { left, top, width, height } = this.canvas.getBoundingClientRect();
      const caster = new THREE.Raycaster();
      caster.setFromCamera(new THREE.Vector2((event.clientX - left) / width * 2 - 1,
        1 - (event.clientY - top) / height * 2), this.camera);
      return caster;
    },

    pointAt(event, height) {
      const plane = new THREE.Plane(new THREE.Vector3(0, 0, 1), -height);
      return this.ray(event).ray.intersectPlane(plane, new THREE.Vector3());
    },

    // A click on a vehicle chooses it, one on the floor sets the goal, whose handle can be dragged.
    listen() {
      let start = null, isDragging = false, dragged = null;
      const on = (name, act) => this.$el.addEventListener(name, act, { capture: true });
      const tell = ({ x, y }) => this.$emit("goal", { x, y });
      on("wheel", () => { this.isTouched = true; });
      on("pointerdown", (event) => {
        this.isTouched = true;  // All vehicles that come are in the view until then.
        start = [event.clientX, event.clientY];
        isDragging = this.goal.visible && this.ray(event).intersectObject(this.goal.handle).length > 0;
        dragged = this.isWaypointing ? this.waypoints.hit(this.ray(event)) : null;
        if (isDragging || dragged) event.stopPropagation();  // The view is not to turn.
      });
      on("pointermove", (event) => {
        const place = isDragging && this.pointAt(event, this.goal.height);
        if (place) this.change(() => this.goal.moveTo(place.x, place.y));
        const there = dragged && this.pointAt(event, dragged.z);
        if (there) this.change(() => this.waypoints.moveTo(dragged.number, there));
      });
      on("pointerup", (event) => {
        if (start === null || event.button !== 0) return;
        const isClick = Math.hypot(event.clientX - start[0], event.clientY - start[1]) < CLICK;
        start = null;
        const tellWaypoint = (number, { x, y }, z, moves) => this.$emit("waypoint", { number, x, y, z, moves });
        if (isDragging) {
          isDragging = false;
          tell(this.goal.position);
        } else if (dragged) {
          tellWaypoint(dragged.number, this.waypoints.points[dragged.number], null, true);
          dragged = null;
        } else if (isClick) {
          const hit = this.ray(event).intersectObject(this.vehicles.body)[0];
          const place = this.pointAt(event, 0);
          const on = this.isWaypointing && this.waypoints.hitLine(this.ray(event));
          if (event.shiftKey) {
            const point = hit ? this.vehicles.positionOf(this.vehicles.names[hit.instanceId]) : place;
            if (point) this.change(() => this.measure.mark(point));
          } else if (on) tellWaypoint(on.number, on.point, on.point.z, false);
          else if (this.isWaypointing && place) tellWaypoint(this.waypoints.points.length, place, null, false);
          else if (hit) {
            this.$emit("choose", { name: this.vehicles.names[hit.instanceId],
              add: event.ctrlKey });
          } else if (place) tell(place);
        }
      });
    },

    // Remove what was set in the scene.
    clear() { this.change(() => this.measure.mark(null)); },

    // Take the colors of the page, which follow the system's setting.
    setColors() {
      const style = getComputedStyle(document.documentElement), of = (name) => new THREE.Color(style.getPropertyValue(name).trim());
      this.change(() => {
        this.scene.background = of("--scene");
        this.grid.material.transparent = true;
        this.grid.material.opacity = matchMedia("(prefers-color-scheme: light)").matches ? 0.2 : 1;
        this.floor.material.uniforms.color.value = of("--floor");
      });
    },

    // Return where a point (m) is in the window, px.
    screen(x, y, z) {
      const place = new THREE.Vector3(x, y, z).project(this.camera);
      const { left, top, width, height } = this.canvas.getBoundingClientRect();
      return [left + (place.x + 1) / 2 * width, top + (1 - place.y) / 2 * height];
    },
  },
};
